"""Sequential thresholding on unique shares as an optimizer of pysindy, and as the choice behind every other door.

A term's *unique share* is the moment, relative to the RMS of all of it, that no combination of the other terms can
take over. The candidate of the least share goes, survivors are exchanged for removed ones where that fits better, and
the threshold at which this ends is a number or is chosen by evidence (:mod:`sindyjoint.discovery.selection`). What is
found is a model of pysindy, too: print, equations, coefficients, predict, score, simulate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pysindy import SINDy
from pysindy.optimizers.base import BaseOptimizer
from sklearn.utils.validation import check_array, check_consistent_length

from sindyjoint.discovery import Evidence
from sindyjoint.discovery.factors import dependent_columns
from sindyjoint.discovery.library import TermLibrary
from sindyjoint.discovery.regression import SelectionRules, TermRegression, choose
from sindyjoint.discovery.rows import Rows, gather_columns, row_labels, rows_that_count
from sindyjoint.discovery.selection import Selection
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, UnknownNameError
from sindyjoint.numeric import Array

Column = int | str


@dataclass(eq=False, repr=False, kw_only=True)
class UniqueShareSTLSQ(SelectionRules, BaseOptimizer):
    """Sequentially thresholded least squares on unique shares, with exchange.

    Where pysindy's ``STLSQ`` compares coefficients with a threshold, this compares what each term alone carries of the
    target: the answer depends neither on units and scales of the columns nor on the number of samples, and a term that
    another one can replace has no share however large its coefficient is. There is no ridge.

    Parameters
    ----------
    threshold : float, optional
        Least unique share in the RMS of the target, from 0 to below 1. ``None``: chosen by evidence.
    selection : {"evidence", "one_standard_error"}
        How the threshold is chosen where ``threshold`` is None.
    significance : float
        Least ratio of coefficient to standard error.
    least_share : float
        Least unique share that ``selection="evidence"`` lets pass.
    forced, forbidden : sequence of int or str
        Columns that are never removed, or never used; by name where ``feature_names`` are given.
    signs : mapping of int or str to int, optional
        Column to the sign, +1 or -1, that its coefficient must have.
    groups, runs, blocks : array_like, shape (n,), optional
        Of every row: what is held out together (usually the excitation frequency), the run, and the replicate block
        within the run. Default: stretches of consecutive rows. ``pysindy.SINDy`` concatenates a list of runs before
        its optimizer sees them, and hands on no labels; so they are parameters.
    replicate : tuple of (ndarray, shape (n, p), and ndarray, shape (n,)), optional
        The rows as each block alone gives them (columns and target); their scatter carries the noise of the state.
    feature_names : sequence of str, optional
        Names of the columns.
    method : str or optimizer of pysindy
        How the path of models is made, as of :class:`~sindyjoint.JointRegressor`.
    random_state : int, Generator or None
        For methods that resample.

    Attributes
    ----------
    coef_ : ndarray, shape (n_targets, p)
    history_ : list of ndarray, shape (n_targets, p)
        Coefficients of the models of the path, from the largest to the smallest.
    selection_result_ : Selection
        The path of models, the one chosen on it and the reason; of the first target.
    selections_ : tuple of Selection
        Of every target.
    evidence_ : Evidence
        Factors of all runs and blocks, with the first target.
    left_out_ : tuple of int
        Columns that are forbidden, or on these rows combinations of those before them.
    least_share_ : float
        Least unique share that was let pass.

    Examples
    --------
    >>> import numpy as np, pysindy
    >>> from sindyjoint import TermLibrary, UniqueShareSTLSQ
    >>> rng = np.random.default_rng(0)
    >>> x = rng.uniform(-1, 1, (4000, 2)) * [8e-4, 0.02]
    >>> moment = 6066 * x[:, 0] - 2.684e9 * x[:, 0] ** 3 + 1.867 * np.sign(x[:, 1]) + 0.01 * rng.normal(size=4000)
    >>> model = pysindy.SINDy(feature_library=TermLibrary("extended"), optimizer=UniqueShareSTLSQ())
    >>> names = model.fit(x, 1e-3, x_dot=moment[:, None]).get_feature_names()
    >>> [name for name, value in zip(names, model.coefficients()[0]) if value]
    ['linear_stiffness', 'cubic_stiffness', 'coulomb_friction']
    """

    threshold: float | None = field(default=None, kw_only=False)  # positional, as of STLSQ
    forbidden: Sequence[Column] = ()
    groups: ArrayLike | None = None
    runs: ArrayLike | None = None
    blocks: ArrayLike | None = None
    replicate: tuple[ArrayLike, ArrayLike] | None = None
    feature_names: Sequence[str] | None = None

    def __post_init__(self) -> None:
        BaseOptimizer.__init__(self, unbias=False)

    def set_params(self, **parameters: Any) -> UniqueShareSTLSQ:
        """Set parameters and return the optimizer, as scikit-learn wants it (pysindy returns nothing)."""
        super().set_params(**parameters)
        return self

    def fit(
        self,
        x_: ArrayLike,
        y: ArrayLike,
        sample_weight: ArrayLike | None = None,
        groups: ArrayLike | None = None,
        runs: ArrayLike | None = None,
        blocks: ArrayLike | None = None,
        **reduce_kws: Any,
    ) -> UniqueShareSTLSQ:
        """Choose columns and fit their coefficients.

        Parameters
        ----------
        x_ : array_like, shape (n, p)
            Columns of the candidates; rows of one run follow one another in time.
        y : array_like, shape (n,) or (n, n_targets)
            Target, the moment; each one gets a choice of its own.
        sample_weight : array_like, shape (n,), optional
        groups, runs, blocks : array_like, shape (n,), optional
            In the place of the parameters of the same names.

        Raises
        ------
        InputError, UnknownNameError
            For rows, labels or parameters that cannot be used.
        """
        if reduce_kws:
            raise InputError(
                f"fit got {next(iter(reduce_kws))!r}; sample_weight, groups, runs and blocks are known"
            )
        self.check_rules()
        columns = check_array(np.asarray(x_), dtype=np.float64)
        targets = check_array(np.asarray(y), dtype=np.float64, ensure_2d=False)
        check_consistent_length(columns, targets)
        targets = targets.reshape(len(columns), -1)
        given = [
            of_fit if of_fit is not None else of_self
            for of_fit, of_self in ((groups, self.groups), (runs, self.runs), (blocks, self.blocks))
        ]
        weight, columns, targets, *given, of_columns, of_target = rows_that_count(
            sample_weight, len(columns), columns, targets, *given, *(self.replicate or (None, None))
        )
        labels = row_labels(len(columns), *given)
        names = self._names(columns.shape[1])
        replicate = self._replicate(Rows(columns, targets[:, 0], weight), of_columns, of_target)
        shared = replicate is not None and np.array_equal(replicate.X, columns)
        found = [
            self._choice(gather_columns(names, Rows(columns, target, weight), labels, replicate), shared)
            for target in targets.T
        ]
        self._keep(found, names)
        self.Theta_ = columns
        return self

    def fit_evidence(self, evidence: Evidence, *, shared_motion: bool = False) -> UniqueShareSTLSQ:
        """Choose columns from their factors, of rows that are not in memory.

        Parameters
        ----------
        evidence : Evidence
            Of all columns.
        shared_motion : bool
            Whether the blocks of a run share one estimate of the motion.
        """
        self.check_rules()
        self._keep([self._choice(evidence, shared_motion)], evidence.ids)
        return self

    @classmethod
    def of_regression(cls, regression: TermRegression) -> UniqueShareSTLSQ:
        """Return the optimizer that chose the terms of a regression, fitted."""
        optimizer = cls(**{each.name: getattr(regression, each.name) for each in fields(SelectionRules)})
        optimizer.least_share_ = regression.least_share_
        optimizer._keep([(regression.evidence_, regression.selection_result_)], regression.evidence_.ids)
        return optimizer

    def _choice(self, evidence: Evidence, shared_motion: bool) -> tuple[Evidence, Selection]:
        """Return the evidence on the columns that may be used, and the choice among them."""
        names = evidence.ids
        dropped = {self._name(names, "forbidden", column) for column in self.forbidden}
        evidence = evidence.take([i for i, name in enumerate(names) if name not in dropped])
        dependent = dependent_columns(evidence.pooled)
        evidence = evidence.take([i for i in range(len(evidence.ids)) if i not in dependent])
        forced = [self._name(names, "forced", column) for column in self.forced]
        signs = {self._name(names, "signs", column): sign for column, sign in (self.signs or {}).items()}
        selection, self.least_share_ = choose(
            evidence, replace(self, forced=forced, signs=signs), shared_motion
        )
        return evidence, selection

    def _names(self, count: int) -> tuple[str, ...]:
        if self.feature_names is None:
            return tuple(f"column {i}" for i in range(count))
        if len(self.feature_names) != count:
            raise InputError(f"feature_names has {len(self.feature_names)} names; one for each of {count} columns "
                             "is expected")  # fmt: skip
        return tuple(self.feature_names)

    def _name(self, names: Sequence[str], option: str, column: Column) -> str:
        """Return the name of a column that an option gives by name or index."""
        if isinstance(column, str):
            if column in names:
                return column
            hint = "" if self.feature_names is not None else "; give feature_names to name columns"
            raise UnknownNameError(
                f"{option} names {column!r}, which is not among the candidates: {', '.join(names)}{hint}"
            )
        if not -len(names) <= column < len(names):
            raise InputError(f"{option} names column {column}; there are {len(names)} columns")
        return names[column]

    def _replicate(self, rows: Rows, columns: ArrayLike | None, target: ArrayLike | None) -> Rows | None:
        """Return the rows as each block alone gives them, if they were given."""
        if self.replicate is None:
            return None
        other, other_target = (np.asarray(part, dtype=np.float64) for part in (columns, target))
        if other.shape != rows.X.shape or other_target.shape != rows.y.shape:
            raise InputError(f"replicate has shapes {other.shape} and {other_target.shape}; "
                             f"{rows.X.shape} and {rows.y.shape} are expected")  # fmt: skip
        return rows.again(other, other_target)

    def _keep(self, found: Sequence[tuple[Evidence, Selection]], names: Sequence[str]) -> None:
        """Keep what a fit learned, and nothing of an earlier one."""
        place = {name: index for index, name in enumerate(names)}
        steps = max(len(selection.path) for _, selection in found)
        history = np.zeros((steps, len(found), len(names)))
        self.coef_ = np.zeros((len(found), len(names)))
        for row, (evidence, selection) in enumerate(found):
            where = [place[name] for name in evidence.ids]
            for at, step in enumerate(selection.path):
                history[at:, row] = 0.0
                history[at:, row, [where[c] for c in step.columns]] = step.fit.coefficients
            if selection.step is not None:
                chosen = selection.step.fit
                self.coef_[row, [where[c] for c in chosen.columns]] = chosen.coefficients
        self.evidence_, self.selection_result_ = found[0]
        self.selections_ = tuple(selection for _, selection in found)
        self.left_out_ = tuple(i for i, name in enumerate(names) if name not in self.evidence_.ids)
        self.history_ = list(history) or [self.coef_]
        self.ind_ = self.coef_ != 0
        self.intercept_ = 0.0
        self.n_features_in_ = len(names)

    def _reduce(self, x: Any, y: Any) -> None:
        raise NotImplementedError("fit does all of the work")


Simulator = Callable[[Array, Array, Array], Array]


class JointSINDy(SINDy):
    """A fitted ``pysindy.SINDy`` whose target is the moment of a joint over its angle and rate.

    The feature library is a :class:`~sindyjoint.TermLibrary` in physical units and the optimizer a
    :class:`~sindyjoint.UniqueShareSTLSQ`, so all numbers that pysindy prints are in N·m, rad and s (N, m and s).

    Parameters
    ----------
    optimizer, feature_library, differentiation_method
        As of ``pysindy.SINDy``.
    simulator : callable, optional
        ``(x0, t, moment) -> states``, for :meth:`simulate`.
    """

    def __init__(
        self,
        optimizer: Any = None,
        feature_library: Any = None,
        differentiation_method: Any = None,
        simulator: Simulator | None = None,
    ):
        super().__init__(
            optimizer=UniqueShareSTLSQ() if optimizer is None else optimizer,
            feature_library=TermLibrary(scale=None) if feature_library is None else feature_library,
            differentiation_method=differentiation_method,
        )
        self.simulator = simulator

    @classmethod
    def of(
        cls, regressor: TermRegression, model: JointModel, simulator: Simulator | None = None
    ) -> JointSINDy:
        """Return what a fitted regressor found, with the coefficients of a model of the same terms.

        Parameters
        ----------
        regressor : TermRegression
        model : JointModel
            The regressor's own, or the one whose bias is taken out.
        simulator : callable, optional
        """
        values = {term.id: term.coefficient for term in model.terms}
        optimizer = UniqueShareSTLSQ.of_regression(regressor)
        optimizer.coef_ = np.array([[values.get(term.id, 0.0) for term in regressor.terms_]])
        optimizer.ind_, optimizer.n_features_in_ = optimizer.coef_ != 0, len(regressor.terms_)
        found = cls(optimizer, TermLibrary.of_regression(regressor), simulator=simulator)
        found.feature_names = ["angle", "rate", "acceleration"][: regressor.n_features_in_]
        found.n_control_features_ = 0
        found._fit_shape()
        return found

    def print(self, lhs: list[str] | None = None, precision: int = 3, **options: Any) -> None:
        """Print the equation of the moment; parameters are those of ``pysindy.SINDy.print``."""
        super().print(["M"] if lhs is None else lhs, precision, **options)

    def simulate(self, x0: ArrayLike, t: ArrayLike, u: ArrayLike | None = None, **options: Any) -> Array:
        """Simulate the joint under a moment with exact sticking, which pysindy's integrators do not know.

        Parameters
        ----------
        x0 : array_like, shape (2,)
            Angle rad and rate rad/s at the first instant.
        t : array_like, shape (n,)
            Evenly spaced instants, s.
        u : array_like, shape (n,)
            Moment at the sensor at these instants, N·m.

        Returns
        -------
        ndarray, shape (n, 2)
            Angle and rate.

        Raises
        ------
        InputError
            Without a moment or an inertia, for instants that are not evenly spaced, or for options of integrators.
        """
        if self.simulator is None:
            raise InputError("simulate needs a discovered joint: use the sindy of a Discovery")
        if options:
            raise InputError(f"simulate got {next(iter(options))!r}; x0, t and u are known")
        if u is None:
            raise InputError("simulate needs the moment that drives the joint: u, shape (n,), N·m")
        time, moment = np.asarray(t, dtype=np.float64), np.asarray(u, dtype=np.float64).reshape(-1)
        if time.ndim != 1 or time.size < 2 or moment.shape != time.shape:
            raise InputError(
                f"t has shape {time.shape} and u {moment.shape}; (n,) and (n,) with n ≥ 2 are expected"
            )
        if not np.allclose(np.diff(time), time[1] - time[0], rtol=1e-6, atol=0.0):
            raise InputError("t is not evenly spaced")
        return self.simulator(np.asarray(x0, dtype=np.float64), time, moment)
