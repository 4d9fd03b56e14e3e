"""Limits of the verdicts: on the paper's five terms, and of a verification."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import SharedPolicy, limit


@dataclass(frozen=True)
class VerdictPolicy(SharedPolicy):
    """Limits that decide a verdict; the meaning of each is in its metadata."""

    predicts: float = limit(
        1.1,
        "ratio of two RMS errors up to which they are one: gap over noise floor, held-out error over residual",
        source="500 campaigns (results/calibration.json): periodic runs, multisines and sweeps leave at most 1.06 "
        "floors under the true law; laws that lack an effect of 3 to 12 % (seeds 7001 to 7004) leave 1.02 to 6.8",
    )


POLICY = VerdictPolicy()
