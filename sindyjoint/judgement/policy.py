"""Limits of the verdicts: on the paper's five terms, and of a verification."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import limit


@dataclass(frozen=True)
class VerdictPolicy:
    """Limits that decide a verdict; the meaning of each is in its metadata."""

    negligible_share: float = limit(
        0.01,
        "a term of the paper is ruled out when even the end of its 95 % interval carries less than this share of the "
        "moment",
        source="chosen by judgement",
    )
    noise_uncertainty: float = limit(
        0.3,
        "a misfit below this share of the noise floor may be the floor's error",
        source="the floor is known to a few per cent, the misfit is a root of a difference of squares",
    )
    refined_apart: float = limit(
        3.0,
        "combined standard errors by which coefficients by regression and on the simulated response may differ without "
        "a warning",
        source="convention",
    )
    mostly_explained: float = limit(
        0.2,
        "share of the moment's RMS, beyond the noise, above which a fit is called poor",
        source="chosen by judgement: it leaves 4 % of the power",
    )
    predicts: float = limit(
        1.1,
        "held-out error over residual up to which a model predicts as well as it fits",
        source="chosen by judgement",
    )
    predicts_roughly: float = limit(
        2.0, "held-out error over residual above which a model does not predict", source="chosen by judgement"
    )
    enough: int = limit(
        3,
        "frequencies, and levels, from which on terms that are alike on one run are distinguished",
        source="the campaigns of the guide; two of each leave no group to check on",
    )
    surely_chosen: float = limit(
        0.95,
        "share of resampled campaigns in which every term of the model is chosen, from which on the set is stable",
        source="convention",
    )
    often_chosen: float = limit(
        0.5, "share of resampled campaigns below which a term is in the model by chance", source="convention"
    )
    change_margin: float = limit(
        0.10, "relative change of a coefficient between two tests that would not matter, unless given"
    )
    change_level: float = limit(
        0.05,
        "risk of calling any coefficient of an unchanged joint changed, over all of them together",
        source="convention",
    )
    verification_tolerance: float = limit(
        0.05, "largest response NRMSE beyond the noise floor that passes", source="chosen by judgement"
    )


POLICY = VerdictPolicy()
