"""Ways to make a path of models: our own sequential thresholding, and pysindy's optimisers behind one door.

Every method sees the same thing: the triangular factor of the RMS-scaled candidates and target, which has the same
least-squares problem as the samples. Every call builds its optimiser afresh, because pysindy's keep state. What a
method yields is a sequence of column sets; fits, uncertainties and the choice on the path are the same for all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.discovery.evidence import Evidence
from sindyjoint.discovery.factors import Factor
from sindyjoint.discovery.selection import elimination_path

Array = NDArray[np.float64]
Path = list[tuple[int, ...]]

# Thresholds on scaled coefficients, as shares of the target's RMS.
THRESHOLDS = np.geomspace(1e-4, 1.0, 49)


def _stlsq(factor: Factor, forced: Sequence[int]) -> Path:
    """Sequentially thresholded least squares on unique shares, one term at a time, with exchange."""
    return elimination_path(factor, forced)


def _coefficient_stlsq(factor: Factor, forced: Sequence[int]) -> Path:
    """Pysindy's STLSQ on RMS-scaled columns, all coefficients below the threshold removed at once."""
    from pysindy.optimizers import STLSQ

    return _threshold_path(
        factor, lambda threshold: STLSQ(threshold=threshold, alpha=0.0, unbias=False), forced
    )


def _sr3(factor: Factor, forced: Sequence[int]) -> Path:
    """Pysindy's SR3 with the l0 penalty; its threshold is √(2·weight/ν) on scaled coefficients."""
    from pysindy.optimizers import SR3

    def build(threshold: float) -> Any:
        return SR3(
            reg_weight_lam=threshold**2 / 2,
            regularizer="L0",
            relax_coeff_nu=1.0,
            unbias=False,
            max_iter=300,
            tol=1e-9,
        )

    return _threshold_path(factor, build, forced)


def _ssr(factor: Factor, forced: Sequence[int]) -> Path:
    """Pysindy's stepwise sparse regressor: the smallest scaled coefficient goes, one at a time."""
    from pysindy.optimizers import SSR

    return _history_path(factor, SSR(alpha=0.0, unbias=False, max_iter=factor.n_columns), forced)


def _frols(factor: Factor, forced: Sequence[int]) -> Path:
    """Pysindy's forward regression by error reduction ratio (Billings 2013)."""
    from pysindy.optimizers import FROLS

    return _history_path(factor, FROLS(alpha=0.0, unbias=False, max_iter=factor.n_columns), forced)


METHODS: dict[str, Callable[[Factor, Sequence[int]], Path]] = {
    "stlsq": _stlsq,
    "coefficient_stlsq": _coefficient_stlsq,
    "sr3": _sr3,
    "ssr": _ssr,
    "frols": _frols,
}


def column_path(
    method: str, evidence: Evidence, forced: Sequence[int] = (), random_state: Any = None
) -> Path:
    """Return the column sets that a method proposes, from large to small, each once.

    Parameters
    ----------
    method : str
        One of :data:`METHODS`.
    evidence : Evidence
    forced : sequence of int
        Columns that every set holds.
    random_state : int, Generator or None
        For methods that resample.
    """
    sets = METHODS[method](evidence.pooled, tuple(forced))
    unique = dict.fromkeys(tuple(sorted(s)) for s in sets if s)
    return sorted(unique, key=len, reverse=True)


def _quiet(fit: Callable[[], Any]) -> Any:
    """Run a pysindy fit; its notices that a threshold removed everything are what a path is made of."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return fit()


def _threshold_path(factor: Factor, build: Callable[[float], Any], forced: Sequence[int]) -> Path:
    scaled, _, _ = factor.normalised()
    columns, target = scaled.triangle[:, :-1], scaled.triangle[:, -1:]
    path: Path = [tuple(range(scaled.n_columns))]
    for threshold in THRESHOLDS:
        optimiser = build(float(threshold))
        _quiet(lambda optimiser=optimiser: optimiser.fit(columns, target))  # type: ignore[misc]
        path.append(_nonzero(optimiser.coef_, forced))
    return path


def _history_path(factor: Factor, optimiser: Any, forced: Sequence[int]) -> Path:
    scaled, _, _ = factor.normalised()
    columns, target = scaled.triangle[:, :-1], scaled.triangle[:, -1:]
    _quiet(lambda: optimiser.fit(columns, target))
    return [tuple(range(scaled.n_columns)), *(_nonzero(c, forced) for c in optimiser.history_)]


def _nonzero(coefficients: Any, forced: Sequence[int]) -> tuple[int, ...]:
    values = np.asarray(coefficients, dtype=float)
    values = values.reshape(-1, values.shape[-1])[0] if values.ndim > 1 else values
    return tuple(sorted({*np.flatnonzero(values).tolist(), *forced}))
