"""What the model lacks: gaps, candidate effects and their probabilities, verdict, budget, localisation, advice."""

from sindyjoint.hooks import fetched

__getattr__ = fetched(
    __name__,
    {
        "effects": "load_effects read_effects select_effects",
        "effects.change": "JointLaws joint_changes steady_level structure_changes",
        "effects.fitted": "FittedEffect effect_law input_effects",
        "effects.setup": "JoinedMotions MeasuredMotion Scales Setup",
        "engine": "Stages explain_gap",
        "evidence": "rank",
        "problem": "Progress add_effects",
        "parts": "Budget",
        "policy": "CAMPAIGN STRUCTURE",
        "result": "Advice Gap Step",
        "structure.gap": "regions_of",
        "structure.pulses": "record_noise",
        "structure.in_place": "runs_problem",
        "structure.start": "hide",
        "verdict": "Gaps Residual discount grows judge reported_together share_beyond_noise with_falling_gaps",
    },
)
