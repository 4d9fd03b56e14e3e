"""The choice of terms from their evidence: one set of rules for the estimator, the optimizer and long runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

from sindyjoint.discovery.evidence import Evidence
from sindyjoint.discovery.methods import check_method, column_path
from sindyjoint.discovery.policy import POLICY
from sindyjoint.discovery.selection import (
    Selection,
    choose_by_evidence,
    choose_by_one_standard_error,
    choose_by_threshold,
    path_of,
)
from sindyjoint.errors import InputError, UnknownNameError

SELECTIONS = ("evidence", "one_standard_error")


@dataclass(frozen=True)
class SelectionRules:
    """How terms are chosen.

    Parameters
    ----------
    method : str or optimizer of pysindy
        As :func:`sindyjoint.discovery.methods.column_path` takes it.
    selection : {"evidence", "one_standard_error"}
        How the threshold is chosen where ``threshold`` is None.
    threshold : float, optional
        Least unique share in the RMS of the target.
    significance : float
        Least ratio of coefficient to standard error.
    least_share : float
        Least unique share that ``selection="evidence"`` lets pass.
    forced : sequence of str
        Ids of columns that are never removed.
    signs : mapping of str to int
        Id of a column to the sign, +1 or -1, that its coefficient must have.
    random_state : int, Generator or None
    """

    method: Any = "stlsq"
    selection: str = "evidence"
    threshold: float | None = None
    significance: float = POLICY.term_significance
    least_share: float = POLICY.least_share
    forced: Sequence[str] = ()
    signs: Mapping[str, int] = field(default_factory=dict)
    random_state: Any = None

    @classmethod
    def of(cls, estimator: Any, forced: Sequence[str], signs: Mapping[str, int]) -> SelectionRules:
        """Return the rules in the parameters of an estimator, with these names of columns."""
        held = {f.name: getattr(estimator, f.name) for f in fields(cls) if f.name not in ("forced", "signs")}
        return cls(**held, forced=tuple(forced), signs=dict(signs))

    def check(self) -> None:
        """Refuse a method, a selection or a number that there is not: UnknownNameError, InputError."""
        check_method(self.method)
        if self.selection not in SELECTIONS:
            raise UnknownNameError(
                f"selection is {self.selection!r}; expected one of {', '.join(SELECTIONS)}"
            )
        if self.threshold is not None and not 0 <= self.threshold < 1:
            raise InputError(
                f"threshold is {self.threshold!r}; expected a share of the moment's RMS, from 0 to below 1"
            )
        for term, sign in self.signs.items():
            if sign not in (1, -1):
                raise InputError(f"signs: {term!r} is {sign!r}; expected +1 or -1")


def choose(evidence: Evidence, rules: SelectionRules, shared_motion: bool = False) -> tuple[Selection, float]:
    """Return the path of models with the choice on it, and the least share that was let pass.

    Parameters
    ----------
    evidence : Evidence
    rules : SelectionRules
    shared_motion : bool
        Whether the blocks of a run share one estimate of the motion: their scatter then lacks its noise, and a term
        must carry 0.15 of the residual.

    Raises
    ------
    UnknownNameError
        For a forced or signed column that is not among the evidence's.
    """
    forced = [_index(evidence, "forced", term) for term in rules.forced]
    signs = {_index(evidence, "signs", term): int(sign) for term, sign in rules.signs.items()}
    least = rules.least_share
    if evidence.pooled.squared_target == 0:
        return Selection((), None, "the moment is zero throughout"), least
    path = path_of(evidence, column_path(rules.method, evidence, forced, rules.random_state, signs))
    if rules.threshold is not None:
        return choose_by_threshold(path, rules.threshold, forced, signs), least
    if rules.selection == "one_standard_error":
        return choose_by_one_standard_error(path, signs), least
    if shared_motion:
        residual = path[0].fit.residual_rms / evidence.target_rms
        least = max(least, POLICY.share_of_residual * residual)
    return choose_by_evidence(path, rules.significance, least, forced, signs), least


def _index(evidence: Evidence, option: str, term_id: str) -> int:
    if term_id not in evidence.ids:
        raise UnknownNameError(
            f"{option} names {term_id!r}, which is not among the candidates: {', '.join(evidence.ids)}"
        )
    return evidence.ids.index(term_id)
