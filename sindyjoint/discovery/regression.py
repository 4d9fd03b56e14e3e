"""The regression of a joint's moment on candidate terms, whole: rows in, chosen terms with their coefficients out.

Every door is this one; :class:`~sindyjoint.JointRegressor` gives it to scikit-learn.
"""

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from sindyjoint.clock import single_threaded
from sindyjoint.discovery import Evidence
from sindyjoint.discovery.factors import Factor, dependent_columns
from sindyjoint.discovery.methods import check_method, column_path
from sindyjoint.discovery.rows import (
    Rows,
    gather,
    held_out_groups,
    row_labels,
    row_weights,
    rows_that_count,
    state_columns,
)
from sindyjoint.discovery.selection import (
    Selection,
    choose_by_evidence,
    choose_by_one_standard_error,
    choose_by_threshold,
    path_of,
)
from sindyjoint.equation.candidates import catalogue_of, with_dependences
from sindyjoint.equation.catalogue import Catalogue, Reference, load_catalogue
from sindyjoint.equation.model import Fitted, JointModel, model_terms
from sindyjoint.equation.terms import ResolvedTerm
from sindyjoint.errors import InputError, UnknownNameError, refuse
from sindyjoint.inputs import Input, input_names, reference_values, tested_inputs
from sindyjoint.limits import DISCOVERY
from sindyjoint.numeric import Array
from sindyjoint.record import Joint, Motion

SELECTIONS = ("evidence", "one_standard_error")


@dataclass(eq=False, repr=False, kw_only=True)
class SelectionRules:
    """How terms are chosen: what every estimator has as parameters.

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
    signs : mapping of str to int, optional
        Id of a column to the sign, +1 or -1, that its coefficient must have.
    random_state : int, Generator or None
    """

    method: Any = "stlsq"
    selection: str = "evidence"
    threshold: float | None = None
    significance: float = DISCOVERY.term_significance
    least_share: float = DISCOVERY.accuracy
    forced: Sequence[Any] = ()
    signs: Mapping[Any, int] | None = None
    random_state: Any = None

    def check_rules(self) -> None:
        """Refuse a method, a selection or a number that there is not: UnknownNameError, InputError."""
        check_method(self.method)
        if self.selection not in SELECTIONS:
            raise UnknownNameError(
                f"selection is {self.selection!r}; expected one of {', '.join(SELECTIONS)}"
            )
        refuse(
            [
                (
                    self.threshold is not None and not 0 <= self.threshold < 1,
                    f"threshold is {self.threshold!r}; expected a share of the moment's RMS, from 0 to below 1",
                ),
                *(
                    (sign not in (1, -1), f"signs: {str(term)!r} is {sign!r}; expected +1 or -1")
                    for term, sign in (self.signs or {}).items()
                ),
            ]
        )


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
    signs = {_index(evidence, "signs", term): int(sign) for term, sign in (rules.signs or {}).items()}
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
        least = max(least, DISCOVERY.share_of_residual * residual)
    return choose_by_evidence(path, rules.significance, least, forced, signs), least


def _index(evidence: Evidence, option: str, term_id: str) -> int:
    if term_id not in evidence.ids:
        raise UnknownNameError(
            f"{option} names {term_id!r}, which is not among the candidates: {', '.join(evidence.ids)}"
        )
    return evidence.ids.index(term_id)


@dataclass(eq=False, repr=False)
class TermRegression(SelectionRules):
    """Sparse regression of a joint's moment; parameters and attributes are those of a ``JointRegressor``."""

    library: Any = "extended"
    forbidden: Sequence[str] = ()
    fixed: Mapping[str, float] | None = None
    motion: Motion = "rotation"
    inputs: Sequence[str | Input] = ()
    cv: Any = None

    @classmethod
    def parameters(cls) -> tuple[str, ...]:
        """Return the names of the parameters."""
        return tuple(inspect.signature(cls).parameters)

    def again(self) -> Self:
        """Return one of the same parameters that is not fitted."""
        return type(self)(**{name: getattr(self, name) for name in self.parameters()})

    def fit(
        self,
        X: Array,
        y: Array,
        groups: ArrayLike | None = None,
        sample_weight: ArrayLike | None = None,
        *,
        runs: ArrayLike | None = None,
        blocks: ArrayLike | None = None,
        X_replicate: ArrayLike | None = None,
        y_replicate: ArrayLike | None = None,
    ) -> Self:
        """Find the terms and their coefficients; parameters are those of :meth:`sindyjoint.JointRegressor.fit`."""
        self.check_parameters()
        if groups is None and self.cv is not None:
            groups = held_out_groups(self.cv, X, y)
        samples = X.shape[0]
        weight, X, y, groups, runs, blocks, X_replicate, y_replicate = rows_that_count(
            sample_weight, samples, X, y, groups, runs, blocks, X_replicate, y_replicate
        )
        given = row_weights(sample_weight, samples)
        samples = samples if given is None else int(np.count_nonzero(given))
        names = input_names(self.inputs)
        motion = X.shape[1] - len(names)
        if motion not in (2, 3):
            behind = f", then {len(names)} input(s): {', '.join(names)}" if names else ""
            raise InputError(
                f"X has {X.shape[1]} feature(s); 2 (angle, rate) or 3 (angle, rate, acceleration) are expected{behind}"
            )
        labels = row_labels(X.shape[0], groups, runs, blocks)
        parts = [X[rows, motion:] for run in labels for rows in run.blocks]
        self.inputs_ = tested_inputs(self.inputs, parts)
        reference = Reference.of(X[:, 0], X[:, 1], y)
        terms = self.candidates(reference, motion == 3)
        shared = X_replicate is not None and np.array_equal(X_replicate, X)
        with single_threaded():
            rows = Rows(X, y, weight)
            evidence = gather(terms, rows, labels, rows.again(X_replicate, y_replicate), names)
            return self._fit(terms, evidence, reference, samples, X.shape[1], shared)

    def candidates(self, reference: Reference, with_acceleration: bool = False) -> tuple[ResolvedTerm, ...]:
        """Return the candidate terms, their nonlinear parameters at the scales of the data."""
        known = self._inputs
        if known:
            reference = replace(reference, inputs=reference_values(known))
        return tuple(self._catalogue(with_inertia=with_acceleration).resolve(reference))

    @property
    def _inputs(self) -> tuple[Input, ...]:
        """Inputs as the last rows showed them, or, of rows that are not in memory, as they were declared."""
        known = getattr(self, "inputs_", ())
        if tuple(each.name for each in known) == input_names(self.inputs):
            return known
        return tuple(Input(each) if isinstance(each, str) else each for each in self.inputs)

    def fit_evidence(
        self,
        terms: Sequence[ResolvedTerm],
        evidence: Evidence,
        reference: Reference,
        *,
        shared_motion: bool = False,
    ) -> Self:
        """Find the terms from the factors of rows that are not in memory.

        Parameters
        ----------
        terms : sequence of ResolvedTerm
            As :meth:`candidates` gives them.
        evidence : Evidence
            Factors of these terms' columns.
        reference : Reference
            Largest angle and rate of the rows.
        shared_motion : bool
            Whether the blocks of a run share one estimate of the motion; see `X_replicate` of :meth:`fit`.

        Raises
        ------
        InputError
            For parameters or rows that cannot be used.
        """
        self.check_parameters()
        features = 3 if any(term.term.needs_acceleration for term in terms) else 2
        features += len(self.inputs)
        self.inputs_ = self._inputs
        rows = int(evidence.pooled.rows)
        with single_threaded():
            return self._fit(tuple(terms), evidence, reference, rows, features, shared_motion)

    def _fit(
        self,
        terms: tuple[ResolvedTerm, ...],
        evidence: Evidence,
        reference: Reference,
        samples: int,
        features: int,
        shared_motion: bool,
    ) -> Self:
        self.reference_, self.terms_, self.n_features_in_ = reference, terms, features
        if samples <= len(terms):
            raise InputError(
                f"n_samples = {samples} for {len(terms)} candidate terms: too few samples in motion; drive the "
                "joint harder, record longer or faster, or choose a smaller library"
            )
        gathered = self._without_dependent(evidence)
        self._moment_rms = gathered.target_rms
        self.evidence_ = self._with_fixed(gathered)
        self.selection_result_, self.least_share_ = choose(self.evidence_, self, shared_motion)
        self._keep_model(samples, len(evidence.runs))
        return self

    def predict(self, X: Array) -> Array:
        """Return the moment at force states, shape (n,), N·m."""
        if not self.selected_:
            return np.zeros(X.shape[0])
        terms = [term for term in self.terms_ if term.id in self.selected_]
        columns = state_columns(terms, X, input_names(self.inputs))
        return columns @ self.coef_[[term.id in self.selected_ for term in self.terms_]]

    def check_parameters(self) -> None:
        """Refuse a method, a selection or a number that there is not."""
        self.check_rules()
        refuse(
            [
                *(
                    (term in self.forbidden, f"term {term!r} is forced and forbidden; expected one of them")
                    for term in self.forced
                ),
                *(
                    (not np.isfinite(value), f"fixed: {term!r} is {value!r}; expected a finite coefficient")
                    for term, value in (self.fixed or {}).items()
                ),
            ]
        )

    def _catalogue(self, with_inertia: bool) -> Catalogue:
        catalogue = with_dependences(catalogue_of(self.library), self._inputs)
        if with_inertia and "inertia" not in catalogue:
            catalogue = catalogue.union(load_catalogue("inertia"))
        elif not with_inertia and "inertia" in catalogue:
            catalogue = catalogue.without(["inertia"])
        return catalogue.without(self.forbidden) if self.forbidden else catalogue

    def _without_dependent(self, evidence: Evidence) -> Evidence:
        """Leave out candidates that these data cannot distinguish from those before them; refuse what no data could."""
        dependent = dependent_columns(evidence.pooled)
        if not dependent:
            self.indistinct_: tuple[str, ...] = ()
            return evidence
        generic = np.random.default_rng(0).normal(size=(8 * len(self.terms_), self.n_features_in_))
        names, spans = input_names(self.inputs), [np.ptp(each.tested or (0.0, 1.0)) for each in self.inputs_]
        scales = [self.reference_.angle or 1.0, self.reference_.rate or 1.0, 1.0]
        scales = [*scales[: self.n_features_in_ - len(names)], *(span or 1.0 for span in spans)]
        offsets = np.zeros(len(scales))
        offsets[len(scales) - len(names) :] = [each.reference for each in self.inputs_]
        columns = state_columns(self.terms_, offsets + generic * scales, names)
        # Of a person's own term of an input and the one that is offered for it the own one stays.
        own = catalogue_of(self.library)
        never = [
            i
            for i in dependent_columns(Factor.of(columns, np.zeros(generic.shape[0])))
            if not self.terms_[i].term.inputs or evidence.ids[i] in own
        ]
        if never:
            raise InputError(
                f"more terms than independent columns: {', '.join(evidence.ids[i] for i in never)} can be written as "
                "a combination of the other candidates whatever the motion; take one of them out of the library"
            )
        keep = [i for i in range(len(evidence.ids)) if i not in dependent]
        self.indistinct_ = tuple(evidence.ids[i] for i in dependent)
        self.terms_ = tuple(self.terms_[i] for i in keep)
        return evidence.take(keep)

    def _with_fixed(self, evidence: Evidence) -> Evidence:
        """Take what the fixed terms carry out of the target, and remember their share of it."""
        rms = evidence.pooled.column_rms
        self._fixed_share: dict[str, float] = {
            term: abs(value) * rms[_index(evidence, "fixed", term)] / evidence.target_rms
            for term, value in (self.fixed or {}).items()
        }
        return evidence.fixing(self.fixed) if self.fixed else evidence

    def _keep_model(self, samples: int, runs: int) -> None:
        step, ids, count = self.selection_result_.step, [term.id for term in self.terms_], len(self.terms_)
        self.coef_, shares, degrees = np.zeros(count), np.zeros(count), np.ones(count)
        covariance, residual = np.zeros((count, count)), self.evidence_.target_rms
        selected: set[str] = set()
        if step is not None:
            names = [self.evidence_.ids[i] for i in step.fit.columns]
            places = [ids.index(name) for name in names]
            self.coef_[places], shares[places] = step.fit.coefficients, step.fit.unique_share
            degrees[places], residual = step.fit.effective_degrees, step.fit.residual_rms
            covariance[np.ix_(places, places)] = step.fit.covariance
            for name, value in (self.fixed or {}).items():
                self.coef_[ids.index(name)], shares[ids.index(name)] = value, self._fixed_share[name]
            selected = {*names, *(self.fixed or {})}
        # Terms are listed in the order of the catalogue.
        chosen = [i for i, name in enumerate(ids) if name in selected]
        covariance = covariance[np.ix_(chosen, chosen)]
        kept = [self.terms_[i] for i in chosen]
        self.selected_ = tuple(term.id for term in kept)
        self.model_ = JointModel(
            joint=Joint(
                motion=self.motion, inertia=None if self.n_features_in_ - len(self.inputs) == 3 else 0.0
            ),
            inputs=self.inputs_,
            terms=model_terms(
                kept, self.coef_[chosen], covariance, shares[chosen], degrees[chosen], self.motion
            ),
            covariance=tuple(tuple(float(v) for v in row) for row in covariance),
            fitted=Fitted(
                moment_rms=self._moment_rms,
                residual_rms=residual,
                noise_floor=float("nan"),
                moving_fraction=1.0,
                samples=samples,
                runs=runs,
                angle=float(self.reference_.angle or 0.0),
                rate=float(self.reference_.rate or 0.0),
            ),
        )
