"""Which runs to make: the information of each on a joint known only roughly, and which together give most."""

from sindyjoint.hooks import fetched

__getattr__ = fetched(
    __name__,
    {
        "information": "Information Sensors changes_over_band half_widths run_information stacked",
        "plan_file": "plan_text play read_plan",
        "prior": "like_law like_model",
        "runs": "PlannedRun candidates highest_level motion",
        "search": "Choice best_runs",
        "separating_runs": "rivals_of",
    },
)
