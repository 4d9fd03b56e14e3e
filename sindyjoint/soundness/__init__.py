"""What the data cannot show or show wrongly, each as a sentence with its number."""

from sindyjoint.hooks import fetched

__getattr__ = fetched(
    __name__,
    {
        "check": "Check check_data find_faults",
        "detectors.course": "step_of",
        "detectors.sizes": "find_disagreement main_line",
        "finding": "Finding Soundness words_of",
        "law.motions": "MOST_HARMONICS POINTS cycles_of",
        "law.odd_runs": "Held find_odd_runs find_other_scales",
        "masking": "bridge mask_campaign mask_run",
        "record": "record_of",
        "warnings": "identifiability_notes",
    },
)
