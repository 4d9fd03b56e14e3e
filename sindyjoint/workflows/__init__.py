"""The verbs of the command line, as functions: what each takes, the stages it goes through, what it returns."""

from sindyjoint.hooks import fetched

__getattr__ = fetched(
    __name__,
    {
        "batch": "verify_batch",
        "joints.population": "holm median_spread population random_effects",
        "joints": "CampaignRecord FACTORS_FILE find_tasks last_result read_record",
        "joints.summary": "summarised",
        "simulate": "rig_motion",
        "verify": "refine",
    },
)
