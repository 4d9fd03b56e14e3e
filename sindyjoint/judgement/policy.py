"""Limits of the verdicts: on the paper's five terms, and of a verification."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import SharedPolicy, limit


@dataclass(frozen=True)
class VerdictPolicy(SharedPolicy):
    """Limits that decide a verdict; the meaning of each is in its metadata."""

    predicts: float = limit(
        1.1,
        "held-out error over residual up to which a model predicts as well as it fits",
        source="chosen by judgement",
    )


POLICY = VerdictPolicy()
