"""Ways to make a path of models: the sequential thresholding of this package, and pysindy's optimisers behind one door.

Every method sees the same thing: the triangular factors of the candidates and the target, scaled to unit norm,
which pose the same least-squares problem as the samples at the same conditioning. Every call builds its optimiser
afresh, because pysindy's keep state. What a method yields is a sequence of column sets; fits, uncertainties and the
choice on the path are the same for all.
"""

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from sindyjoint.discovery import Evidence
from sindyjoint.discovery.factors import Factor, merge
from sindyjoint.discovery.selection import elimination_path
from sindyjoint.errors import InputError, MissingExtraError, UnknownNameError, nearest
from sindyjoint.numeric import Array

Path = list[tuple[int, ...]]

# Thresholds on scaled coefficients, as shares of the target's RMS.
THRESHOLDS = np.geomspace(1e-3, 1.0, 43)


@dataclass(frozen=True, eq=False)
class Asked:
    """What a method is asked: the evidence, columns that every set holds, signs that coefficients must have."""

    evidence: Evidence
    forced: tuple[int, ...]
    signs: Mapping[int, int]
    rng: np.random.Generator

    @property
    def factor(self) -> Factor:
        """Of all rows."""
        return self.evidence.pooled

    @property
    def all_columns(self) -> tuple[int, ...]:
        """Of all candidates."""
        return tuple(range(self.factor.n_columns))

    @property
    def problem(self) -> tuple[Array, Array]:
        """Columns and target of unit norm, shape (p + 1, p) and (p + 1, 1)."""
        triangle = self.factor.normalised()[0].triangle
        return triangle[:, :-1], triangle[:, -1:]


Method = Callable[[Asked], Path]


def _best_subset(asked: Asked) -> Path:
    """Exact best subset of every size, by branch and bound."""
    from sindyjoint.discovery.best_subset import best_subsets

    return best_subsets(asked.factor, asked.forced, asked.signs)


def _of_pysindy(name: str, **settings: Any) -> Any:
    """Return a fresh optimiser of pysindy."""
    import pysindy.optimizers

    return getattr(pysindy.optimizers, name)(unbias=False, **settings)


def _pysindy_stlsq(threshold: float) -> Any:
    """STLSQ of pysindy on scaled columns, all coefficients below the threshold removed at once."""
    return _of_pysindy("STLSQ", threshold=threshold, alpha=0.0)


def _ensemble(asked: Asked) -> Path:
    """As EnsembleOptimizer of pysindy: STLSQ fits, median of the coefficients, over resampled blocks rather than rows.

    That one draws single rows from the global generator.
    """
    # As many replicates as pysindy's default.
    resampled = [_resampled_blocks(asked) for _ in range(20)]

    def median(threshold: float) -> Any:
        triangles = (factor.triangle for factor in resampled)
        fits = [_pysindy_stlsq(threshold).fit(each[:, :-1], each[:, -1:]).coef_ for each in triangles]
        return np.median(fits, axis=0)

    # A resampled fit costs as many fits as there are replicates: coarser steps.
    return _threshold_path(asked, median, np.geomspace(2e-3, 0.5, 12))


def _lasso_lars(asked: Asked) -> Path:
    """Least-angle regression with the l1 penalty: the sets of its path, the one of least BIC among them.

    Efron, Hastie, Johnstone and Tibshirani, Annals of Statistics 32(2), 2004. Set sizes are met more than once; all
    are kept.
    """
    from sklearn.linear_model import LassoLarsIC, lars_path

    # LassoLarsIC wants the noise variance where rows are no more than columns, as on a factor: that of the full fit.
    corner = asked.factor.normalised()[0].triangle[-1, -1]
    noise = max(corner**2 / max(asked.factor.rows - asked.factor.n_columns, 1), 1e-30)
    columns, target = asked.problem
    fit = LassoLarsIC(criterion="bic", fit_intercept=False, noise_variance=noise)
    _quiet(lambda: fit.fit(columns, target[:, 0]))
    path = _quiet(lambda: lars_path(columns, target[:, 0], method="lasso")[2])
    return [asked.all_columns, _nonzero(fit.coef_, asked), *(_nonzero(c, asked) for c in path.T)]


SR3 = {"regularizer": "L0", "relax_coeff_nu": 1.0, "max_iter": 300, "tol": 1e-7}
METHODS: dict[str, Method] = {
    # Sequentially thresholded least squares on unique shares, one term at a time, with exchange.
    "stlsq": lambda asked: elimination_path(asked.factor, asked.forced, asked.evidence.parents),
    "best_subset": _best_subset,
    # Backward elimination: the term whose removal costs least goes, and does not come back.
    "backward": lambda asked: elimination_path(asked.factor, asked.forced, asked.evidence.parents, 0),
    "coefficient_stlsq": lambda asked: _threshold_path(
        asked, lambda t: _pysindy_stlsq(t).fit(*asked.problem).coef_
    ),
    # SR3 of pysindy with the l0 penalty; its threshold is √(2·weight/ν) on scaled coefficients.
    "sr3": lambda asked: _threshold_path(
        asked, lambda t: _of_pysindy("SR3", reg_weight_lam=t**2 / 2, **SR3).fit(*asked.problem).coef_
    ),
    # SSR of pysindy, the stepwise sparse regressor: the smallest scaled coefficient goes, one at a time.
    "ssr": lambda asked: [
        asked.all_columns,
        *_history_path(asked, _of_pysindy("SSR", alpha=0.0, max_iter=asked.factor.n_columns)),
    ],
    # FROLS of pysindy, forward regression by error reduction ratio (Billings 2013).
    "frols": lambda asked: [
        asked.all_columns,
        *_history_path(asked, _of_pysindy("FROLS", alpha=0.0, max_iter=asked.factor.n_columns)),
    ],
    "ensemble": _ensemble,
    "lasso_lars": _lasso_lars,
}

# What the search for sets cannot be given: the runs that are held out together, the signs of coefficients. The choice
# among the sets has the groups whatever the method, and a set that breaks a sign stands there without the offenders.
NOT_GIVEN: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(METHODS, ("groups", "signs")),
    "best_subset": ("groups",),
}


# ``pysindy:SR3`` is any optimiser of pysindy with its default settings.
PREFIX = "pysindy:"


def check_method(method: Any) -> None:
    """Refuse a method that there is not, in one line: UnknownNameError, MissingExtraError."""
    if method in METHODS if isinstance(method, str) else hasattr(method, "fit"):
        return
    if isinstance(method, str) and method.startswith(PREFIX):
        _named_optimiser(method)
        return
    raise UnknownNameError(
        f"method is {method!r}; expected one of {', '.join(METHODS)}, {PREFIX}NAME for an optimizer of pysindy, or "
        "such an object"
    )


def optimisers() -> dict[str, Any]:
    """Return the optimisers that the installed pysindy has and that can do without further arguments."""
    import inspect

    import pysindy
    from pysindy.optimizers.base import BaseOptimizer

    return {
        name: kind
        for name, kind in inspect.getmembers(pysindy, inspect.isclass)
        if issubclass(kind, BaseOptimizer)
        and not inspect.isabstract(kind)
        and all(
            p.default is not p.empty or p.kind in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
            for p in inspect.signature(kind).parameters.values()
        )
    }


def _named_optimiser(method: str) -> Any:
    """Return a fresh optimiser of the name behind the prefix."""
    name, known = method.removeprefix(PREFIX), optimisers()
    if name not in known:
        raise UnknownNameError(
            f"method is {method!r}; the installed pysindy has no optimizer {name!r}; "
            + nearest(name, list(known), "it has")
        )
    try:
        return known[name]()
    except Exception as error:  # whatever an optimizer wants that is not installed
        raise MissingExtraError(f"method {method!r} cannot be used here: {error}") from error


def _history_path(asked: Asked, optimiser: Any) -> Path:
    """Return the set which an optimiser of pysindy keeps at its own settings, and its history."""
    columns, target = asked.problem
    try:
        _quiet(lambda: optimiser.fit(columns, target))
    except Exception as error:  # a foreign optimizer may raise anything
        raise InputError(
            f"{PREFIX}{type(optimiser).__name__} cannot fit these candidates: {error}"
        ) from error
    history = [np.atleast_2d(np.asarray(c)) for c in getattr(optimiser, "history_", [])]
    kept = [c for c in [*history, np.atleast_2d(optimiser.coef_)] if c.shape == (1, columns.shape[1])]
    return [_nonzero(c, asked) for c in kept]


def column_path(
    method: Any,
    evidence: Evidence,
    forced: Sequence[int] = (),
    random_state: Any = None,
    signs: Mapping[int, int] | None = None,
) -> Path:
    """Return the column sets that a method proposes, from large to small, each once.

    Parameters
    ----------
    method : str or optimizer of pysindy
        One of :data:`METHODS`, ``"pysindy:NAME"`` or an object; of the latter two the sets of its history.
    evidence : Evidence
    forced : sequence of int
        Columns that every set holds.
    random_state : int, Generator or None
        For methods that resample.
    signs : mapping of int to int, optional
        Column to the sign, +1 or -1, that its coefficient must have. Beside each set that breaks it stands the one
        without the offenders.
    """
    signs = dict(signs or {})
    known = METHODS.get(method) if isinstance(method, str) else None
    asked = Asked(evidence, tuple(forced), signs, np.random.default_rng(random_state))
    sets = (
        known(asked)
        if known
        else _history_path(asked, _named_optimiser(method) if isinstance(method, str) else deepcopy(method))
    )
    if signs:
        sets = [s for each in sets for s in (each, obedient(evidence.pooled, each, signs))]
    if evidence.parents:
        sets = [evidence.complete(each) for each in sets]
    unique = dict.fromkeys(tuple(sorted(s)) for s in sets if s)
    return sorted(unique, key=len, reverse=True)


def obedient(factor: Factor, columns: Sequence[int], signs: Mapping[int, int]) -> tuple[int, ...]:
    """Return the columns less those whose fitted coefficient has the wrong sign, the worst first, refitted."""
    kept = [*columns]
    while kept:
        part, _, _ = factor.take(kept).normalised()
        solved = part.solve() / np.linalg.norm(part.inverse(), axis=1)
        wrong = [solved[i] * signs.get(column, 0) for i, column in enumerate(kept)]
        worst = int(np.argmin(wrong))
        if wrong[worst] >= 0:
            break
        kept.pop(worst)
    return tuple(kept)


def _resampled_blocks(asked: Asked) -> Factor:
    """Return the normalised factor of blocks drawn with replacement, as many of each run as it has."""
    drawn = []
    for run in asked.evidence.runs:
        count = len(run.blocks)
        drawn += [run.blocks[i] for i in asked.rng.integers(0, count, count)] if count > 1 else [run.pooled]
    return merge(drawn).normalised()[0]


def _quiet(fit: Callable[[], Any]) -> Any:
    """Run a pysindy fit; its notices that a threshold removed everything are what a path is made of.

    A path is some hundred fits of two dozen rows: scikit-learn's checks of what is known to be sound took a third of
    the time.
    """
    import warnings

    from sklearn import config_context

    with warnings.catch_warnings(), config_context(assume_finite=True, skip_parameter_validation=True):
        warnings.simplefilter("ignore")
        return fit()


def _threshold_path(asked: Asked, fitted: Callable[[float], Any], thresholds: Array = THRESHOLDS) -> Path:
    """Return the sets at all thresholds of coefficients of which no more are kept at a larger one, by halving.

    Where two thresholds keep the same columns, so do those between them, which are not tried; nor are those beyond one
    that keeps the least there can be.
    """
    least = max(1, len(asked.forced))

    @cache
    def at(place: int) -> tuple[int, ...]:
        return _nonzero(_quiet(lambda: fitted(float(thresholds[place]))), asked)

    def between(low: int, high: int) -> Path:
        if len(at(low)) <= least or at(low) == at(high) or high - low < 2:
            return [at(low), at(high)]
        middle = (low + high) // 2
        return between(low, middle) + between(middle, high)

    path = between(0, len(thresholds) - 1)
    end = next((i for i, kept in enumerate(path) if len(kept) <= least), len(path))
    return [asked.all_columns, *path[: end + 1]]


def _nonzero(coefficients: Any, asked: Asked) -> tuple[int, ...]:
    values = np.asarray(coefficients, dtype=float)
    values = values.reshape(-1, values.shape[-1])[0] if values.ndim > 1 else values
    return tuple(sorted({*np.flatnonzero(values).tolist(), *asked.forced}))
