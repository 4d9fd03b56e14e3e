"""Limits of the search over sets: each is an error rate, or a share in units of noise."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import SharedPolicy, limit


@dataclass(frozen=True)
class EvidencePolicy(SharedPolicy):
    """When a set of effects wins over one with less in it, and when two sets cannot be told apart."""

    chance: float = limit(
        0.001,
        "probability that anything is added where there is nothing but noise, all candidates tried",
        source="error rate, measured on simulated noise in the rows of the campaign itself",
    )
    column_error: float = limit(
        0.02,
        "relative error of an effect's column (motions are processed, nonlinear parameters rounded), and share of the "
        "moment that a term of the model carries at least",
        source="free decays with Coulomb friction leave 1 % of what it explains",
    )


POLICY = EvidencePolicy()
