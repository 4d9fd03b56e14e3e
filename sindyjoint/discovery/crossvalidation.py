"""Held-out error of discovery itself: terms and coefficients are found anew without the runs that are predicted.

Folds are made by scikit-learn's splitters over runs, usually one frequency or one level held out at a time; the fits
come from merged factors.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from sindyjoint.described import Maybe
from sindyjoint.discovery.evidence import Evidence
from sindyjoint.discovery.factors import dependent_columns
from sindyjoint.discovery.methods import column_path
from sindyjoint.discovery.selection import Selection, choose_by_evidence, path_of
from sindyjoint.errors import InputError


@dataclass(frozen=True, eq=False)
class Found:
    """What was found on some runs.

    Parameters
    ----------
    candidates : tuple of str
        Ids of the columns that the selection refers to.
    selection : Selection
    """

    candidates: tuple[str, ...]
    selection: Selection

    @property
    def law(self) -> dict[str, float]:
        """Coefficients by term, SI; empty where no set passed."""
        step = self.selection.step
        chosen = () if step is None else zip(step.columns, step.fit.coefficients.tolist(), strict=True)
        return {self.candidates[column]: value for column, value in chosen}


@dataclass(frozen=True)
class Fold:
    """One fold.

    Parameters
    ----------
    left_out : tuple of str
        Labels of the runs that were predicted.
    runs : tuple of str
        Their names.
    kept : tuple of str
        Ids of the terms found without them; empty where no model passed.
    coefficients : tuple of float
        SI.
    moment_error : float
        RMS of the held-out moment's error relative to its RMS; 1 where nothing was found.
    """

    left_out: tuple[str, ...]
    runs: tuple[str, ...]
    kept: tuple[str, ...]
    coefficients: tuple[Maybe, ...]
    moment_error: Maybe


@dataclass(frozen=True)
class CrossValidation:
    """All folds.

    Parameters
    ----------
    folds : tuple of Fold
    """

    folds: tuple[Fold, ...]

    @property
    def moment_error(self) -> float:
        """Root-mean-square of the folds' errors."""
        return pooled_error([fold.moment_error for fold in self.folds])[0]

    @property
    def unanimous(self) -> bool:
        """Whether every fold keeps the same terms."""
        return len({fold.kept for fold in self.folds}) == 1


def pooled_error(errors: Sequence[float]) -> tuple[float, float]:
    """Return the root-mean-square of errors on what was held out, and its standard error by their scatter."""
    squares = np.square(errors)
    whole = float(np.sqrt(np.mean(squares))) if squares.size else float("nan")
    if squares.size < 2:
        return whole, float("nan")
    return whole, float(np.std(squares, ddof=1) / np.sqrt(squares.size) / (2 * max(whole, 1e-300)))


def cross_validate(
    evidence: Evidence,
    labels: Sequence[Any] | None = None,
    splitter: Any = None,
    method: str = "stlsq",
    random_state: Any = None,
    **choice: Any,
) -> CrossValidation:
    """Find a model without the runs of each fold and predict their moment.

    Parameters
    ----------
    evidence : Evidence
    labels : sequence, one per run, optional
        What is held out together: frequency, level. Default: the evidence's groups.
    splitter : scikit-learn splitter, optional
        Over runs. Default: ``LeaveOneGroupOut()``.
    method : str
        One of :data:`~sindyjoint.discovery.methods.METHODS`.
    random_state : int, Generator or None
    **choice
        Of :func:`~sindyjoint.discovery.selection.choose_by_evidence`.

    Raises
    ------
    InputError
        For labels that are not one per run, or all the same.
    """
    from sklearn.model_selection import LeaveOneGroupOut

    names = [run.group for run in evidence.runs] if labels is None else [str(label) for label in labels]
    if len(names) != len(evidence.runs):
        raise InputError(f"{len(names)} label(s) for {len(evidence.runs)} runs; expected one each")
    if splitter is None and len(set(names)) < 2:
        raise InputError(
            f"all runs carry the label {names[0]!r}; expected two different ones to leave one out"
        )
    splitter = LeaveOneGroupOut() if splitter is None else splitter
    index = np.arange(len(names))
    search = partial(find, method=method, random_state=random_state, **choice)
    folds = [
        _fold(evidence, names, train, test, search)
        for train, test in splitter.split(index, groups=np.array(names))
    ]
    return CrossValidation(tuple(folds))


def _fold(
    evidence: Evidence, names: list[str], train: Any, test: Any, search: Callable[[Evidence], Found]
) -> Fold:
    law = search(replace(evidence, runs=tuple(evidence.runs[i] for i in train))).law
    runs = tuple(evidence.runs[i].name for i in test)
    labels = tuple(dict.fromkeys(names[i] for i in test))
    return Fold(labels, runs, tuple(law), tuple(law.values()), moment_error(evidence, runs, law))


def moment_error(evidence: Evidence, runs: Collection[str], law: Mapping[str, float]) -> float:
    """Return the error of the moment of some runs under a law, relative to its RMS."""
    coefficients = np.zeros(len(evidence.ids))
    coefficients[[evidence.ids.index(name) for name in law]] = list(law.values())
    factors = [run.pooled for run in evidence.runs if run.name in runs]
    total = sum(factor.squared_target for factor in factors)
    error = sum(factor.squared_error(coefficients) for factor in factors)
    return float(np.sqrt(error / total)) if total > 0 else float("nan")


def find(evidence: Evidence, method: str = "stlsq", random_state: Any = None, **choice: Any) -> Found:
    """Return what a method and the choice by evidence find.

    Candidates that these runs cannot distinguish from earlier ones (a stop that is never reached, say) are omitted.

    Parameters
    ----------
    evidence : Evidence
    method : str
    random_state : int, Generator or None
    **choice
        Of :func:`~sindyjoint.discovery.selection.choose_by_evidence`.
    """
    dependent = dependent_columns(evidence.pooled)
    possible = evidence.take([column for column in range(len(evidence.ids)) if column not in dependent])
    path = path_of(possible, column_path(method, possible, (), random_state))
    return Found(possible.ids, choose_by_evidence(path, **choice))
