"""Feature libraries of pysindy: the terms of catalogues, and the test functions of the weak form.

Importing this module imports pysindy; nothing else in the catalogue code does.

Multiplied by a test function φ that vanishes at both ends of a segment and integrated over it, M − I·θ̈ = Σ cⱼ fⱼ(θ, θ̇)
becomes ∫φM dt + I·∫φ′θ̇ dt = Σ cⱼ·∫φfⱼ dt, without the acceleration. The joint must move throughout: where it sticks,
the moment is no function of (θ, θ̇).
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pysindy.feature_library.base import BaseFeatureLibrary, x_sequence_or_item
from pysindy.utils import AxesArray, comprehend_axes
from sklearn.utils.validation import check_is_fitted

from sindyjoint.discovery import Evidence
from sindyjoint.discovery.regression import TermRegression
from sindyjoint.discovery.rows import Rows, gather_columns, row_labels, state_columns
from sindyjoint.equation.candidates import catalogue_of, with_dependences
from sindyjoint.equation.catalogue import Catalogue, Reference, load_catalogue
from sindyjoint.equation.model import INERTIA
from sindyjoint.equation.terms import ResolvedTerm, term_columns
from sindyjoint.errors import InputError, MissingExtraError, refuse
from sindyjoint.inputs import Input, input_names, reference_values, tested_inputs
from sindyjoint.limits import DISCOVERY
from sindyjoint.numeric import Array
from sindyjoint.states import ForceStates, group_labels


class TermLibrary(BaseFeatureLibrary):
    """Candidate terms of a joint's law as features of (θ, θ̇) or (θ, θ̇, θ̈).

    A feature is a term of the catalogue divided by its RMS over the data of ``fit``, so a coefficient is the
    RMS moment that its term carries, in N·m, and a threshold of 0.01 drops what carries less than 0.01 N·m,
    for any number of samples. :meth:`physical_coefficients` gives coefficients in the catalogue's units.
    Unscaled columns of θ, θ², θ³ differ by many powers of ten; on those, pysindy's default optimiser silently
    returns wrong coefficients.

    Parameters
    ----------
    library : str, Path, Catalogue, or a sequence of these
        Names of shipped catalogues, paths of TOML files, or catalogues.
    include_inertia : bool
        Whether the term of inertia, ``inertia``, joins them; X then needs the acceleration.
    reference : Reference or mapping, optional
        Scales for nonlinear parameters that are relative to the data; what is omitted is learned in ``fit`` as
        the largest absolute angle and rate. The scale of the moment, which X does not hold, can only be given
        here.
    scale : {"rms", None}
        ``None`` leaves columns in physical units.

    inputs : sequence of str or Input
        What else terms may depend on: the last columns of X (controls ``u`` of ``pysindy.SINDy``). Dependences of the
        catalogue ``"inputs"`` join the terms.

    Attributes
    ----------
    terms_ : tuple of ResolvedTerm
    reference_ : Reference
    scales_ : ndarray, shape (n_terms,)
        RMS of each column; 1 where a column is zero throughout or ``scale`` is None.
    n_features_in_, n_output_features_ : int

    Examples
    --------
    >>> import numpy as np, pysindy
    >>> t = np.linspace(0, 1, 1001)
    >>> x = np.column_stack([8e-4 * np.sin(20 * t), 0.016 * np.cos(20 * t)])
    >>> moment = 6066 * x[:, 0] + 48.13 * x[:, 1] + 1.867 * np.sign(x[:, 1])
    >>> model = pysindy.SINDy(pysindy.STLSQ(threshold=0.05), feature_library=TermLibrary("paper"))
    >>> coefficients = model.fit(x, t, x_dot=moment[:, None]).coefficients()
    >>> model.feature_library.physical_coefficients(coefficients)[0].round(2).tolist()
    [6066.0, 0.0, 0.0, 48.13, 1.87]
    """

    def __init__(
        self,
        library: str | Path | Catalogue | Sequence[str | Path | Catalogue] = "extended",
        include_inertia: bool = False,
        reference: Reference | Mapping[str, float] | None = None,
        scale: str | None = "rms",
        inputs: Sequence[str | Input] = (),
    ):
        self.inputs = inputs
        self.library = library
        self.include_inertia = include_inertia
        self.reference = reference
        self.scale = scale

    @classmethod
    def of_regression(cls, regression: TermRegression) -> "TermLibrary":
        """Return the library of the candidates of a regression, fitted, in physical units."""
        terms, reference = regression.terms_, regression.reference_
        catalogue = Catalogue("candidates", "candidate terms of a fit", tuple(each.term for each in terms))
        library = cls(catalogue, reference=reference, scale=None, inputs=regression.inputs_)
        library.terms_, library.reference_ = terms, reference
        library.n_features_in_, library.n_output_features_ = regression.n_features_in_, len(terms)
        library.scales_ = np.ones(len(terms))
        return library

    @x_sequence_or_item
    def fit(self, x_full: list[Any], y: Any = None) -> "TermLibrary":
        """Resolve the catalogue against the data and learn the columns' scales.

        Parameters
        ----------
        x_full : array_like, shape (n, 2 + k) or (n, 3 + k), or a list of such
            Angle, rate and, if a term needs it, acceleration: rad, rad/s, rad/s²; then the k inputs.
        y : ignored

        Raises
        ------
        InputError
            For data of another shape, values that are not finite, or terms that cannot be evaluated on it.
        """
        if self.scale not in ("rms", None):
            raise InputError(f"scale is {self.scale!r}; expected 'rms' or None")
        names = input_names(self.inputs)
        runs = [_states(x, len(names)) for x in x_full]
        widths = {states.shape[1] for states in runs}
        if len(widths) > 1:
            raise InputError(
                "some trajectories have 2 columns and some 3; expected the same columns in all of them"
            )
        catalogue = catalogue_of(self.library)
        if self.include_inertia:
            catalogue = catalogue.union(load_catalogue("inertia"))
        inputs = tested_inputs(self.inputs, [x[:, x.shape[1] - len(names) :] for x in runs])
        catalogue = with_dependences(catalogue, inputs)
        own = reference_values(inputs)
        self.reference_ = replace(self._reference(runs), inputs=own)
        self.terms_ = catalogue.resolve(self.reference_)
        self.n_features_in_ = widths.pop()
        self.n_output_features_ = len(self.terms_)
        self.scales_ = np.ones(len(self.terms_))
        if self.scale == "rms":
            columns = (state_columns(self.terms_, states, names) for states in runs)
            squares = sum(np.einsum("ij,ij->j", each, each) for each in columns)
            rms = np.sqrt(squares / sum(len(states) for states in runs))
            self.scales_ = np.where(rms > 0, rms, 1.0)
        return self

    @x_sequence_or_item
    def transform(self, x_full: list[Any]) -> list[Any]:
        """Evaluate the terms.

        Parameters
        ----------
        x_full : array_like, shape (n, n_features_in_), or a list of such

        Returns
        -------
        ndarray, shape (n, n_output_features_), or a list of such
        """
        check_is_fitted(self)
        names = input_names(self.inputs)
        runs = [_states(x, len(names)) for x in x_full]
        refuse(
            (
                states.shape[1] != self.n_features_in_,
                f"X has {states.shape[1]} columns; the library was fitted to {self.n_features_in_}",
            )
            for states in runs
        )
        columns = (state_columns(self.terms_, states, names) / self.scales_ for states in runs)
        return [AxesArray(each, comprehend_axes(each)) for each in columns]

    def get_feature_names(self, input_features: Sequence[str] | None = None) -> list[str]:
        """Return the ids of the terms; the names of the inputs do not change them."""
        check_is_fitted(self)
        return [term.id for term in self.terms_]

    def get_feature_names_out(self, input_features: ArrayLike | None = None) -> NDArray[np.object_]:
        """Return the ids of the terms as scikit-learn wants them."""
        return np.array(self.get_feature_names(), dtype=object)

    def physical_coefficients(self, coefficients: ArrayLike) -> NDArray[np.float64]:
        """Return coefficients of the scaled features in the units of the catalogue.

        Parameters
        ----------
        coefficients : array_like, shape (..., n_output_features_)
            As ``SINDy.coefficients()`` gives them.
        """
        check_is_fitted(self)
        return np.asarray(coefficients, dtype=np.float64) / self.scales_

    def _reference(self, runs: list[NDArray[np.float64]]) -> Reference:
        """Take the given scales, and from the data those that are not given."""
        given = self.reference
        if isinstance(given, Mapping):
            unknown = sorted(set(given) - {"angle", "rate", "moment"})
            if unknown:
                raise InputError(f"reference has the key {unknown[0]!r}; angle, rate and moment are known")
            given = Reference(**given)  # type: ignore[arg-type]
        given = given or Reference()
        angle, rate = (max(float(np.abs(states[:, column]).max()) for states in runs) for column in (0, 1))
        return Reference(
            angle=angle if given.angle is None else given.angle,
            rate=rate if given.rate is None else given.rate,
            moment=given.moment,
        )


def _states(x: Any, inputs: int = 0) -> NDArray[np.float64]:
    """Return force states as a plain array, checked."""
    states = np.asarray(x, dtype=np.float64)
    if states.ndim != 2 or states.shape[1] - inputs not in (2, 3) or not len(states):
        behind = f", and {inputs} column(s) of inputs behind them" if inputs else ""
        raise InputError(
            f"X has the shape {states.shape}; expected (n, 2) for angle and rate, or "
            f"(n, 3) with the acceleration{behind}"
        )
    bad = np.argwhere(~np.isfinite(states))
    if bad.size:
        raise InputError(
            f"X holds a value that is not finite in row {bad[0][0]}, column {bad[0][1]}; remove such rows"
        )
    return states


def weak_evidence(
    terms: Sequence[ResolvedTerm], states: Sequence[ForceStates], inertia: float | None
) -> Evidence:
    """Return the factors of a campaign's moment and terms in weak form, by run and replicate block.

    Parameters
    ----------
    terms : sequence of ResolvedTerm
    states : sequence of ForceStates
    inertia : float or None
        kg·m²; ``None``: the inertia is one of the terms.

    Raises
    ------
    InputError
        For a run without a moving segment that is long enough.
    MissingExtraError
        Where the installed pysindy has no weak library.
    """
    parts = [_run_rows(terms, state, inertia or 0.0) for state in states]
    sizes = [len(part[0]) for part in parts]
    columns, target, other, other_target, blocks = (np.concatenate(each) for each in zip(*parts, strict=True))
    groups = runs = None
    if len(states) > 1:
        groups = np.repeat(group_labels(states), sizes)
        runs = np.repeat([state.run for state in states], sizes)
    labels = row_labels(len(columns), groups, runs, blocks)
    return gather_columns(
        [term.id for term in terms], Rows(columns, target), labels, Rows(other, other_target)
    )


def integral_weights(samples: int, interval: float, seed: int = 0) -> tuple[Array, Array]:
    """Return weights w, v of evenly spaced samples: w @ f are the integrals ∫φf dt and v @ f the ∫φf′ dt = −∫φ′f dt.

    Parameters
    ----------
    samples : int
    interval : float
        s.
    seed : int
        Of the centres of the test functions.

    Returns
    -------
    ndarray, shape (K, samples), twice
    """
    import pysindy

    if not hasattr(pysindy, "WeakPDELibrary"):
        raise MissingExtraError(
            f"the weak form needs pysindy's WeakPDELibrary, which pysindy {version('pysindy')} does not have; "
            "leave 'weak' out"
        )
    # A unit impulse at each sample: what the library makes of them are its weights.
    impulses = np.eye(samples)
    before = np.random.get_state()
    # pysindy draws the centres from NumPy's global generator.
    np.random.seed(seed)
    try:
        with warnings.catch_warnings():
            # It labels the axes of its own grid one too many.
            warnings.simplefilter("ignore")
            # pysindy's default for the test functions (1 − s²)ᵖ.
            library = pysindy.WeakPDELibrary(
                function_library=pysindy.PolynomialLibrary(degree=1, include_bias=False),
                spatiotemporal_grid=interval * np.arange(samples),
                K=DISCOVERY.test_functions,
                H_xt=[DISCOVERY.test_half_width * interval * (samples - 1)],
                p=4,
            )
            weights = np.asarray(library.fit(impulses).transform(impulses))
            return weights, np.asarray(library.convert_u_dot_integral(impulses))
    finally:
        np.random.set_state(before)


_weights = lru_cache(maxsize=512)(integral_weights)


def _run_rows(
    terms: Sequence[ResolvedTerm], state: ForceStates, inertia: float
) -> tuple[Array, Array, Array, Array, NDArray[np.intp]]:
    """Return columns and target of a run in weak form, both once more as each block gives them, and the blocks."""
    motion = (state.angle, state.rate, state.acceleration)
    segments = [part for part in _moving_segments(state) if part.size >= DISCOVERY.shortest_segment]
    if not segments:
        raise InputError(
            f"run {state.run!r}: no segment of {DISCOVERY.shortest_segment} samples in which the joint moves one way, "
            "as the weak form needs; leave 'weak' out, or sample faster"
        )
    whole = _integrals(terms, motion, state, segments, inertia)
    other = whole if state.replicate is None else _integrals(
        terms, state.replicate, state, segments, inertia)  # fmt: skip
    blocks = np.repeat([state.block[part[0]] for part in segments], DISCOVERY.test_functions)
    return *whole, *other, blocks


def _integrals(
    terms: Sequence[ResolvedTerm],
    motion: tuple[Array, Array, Array],
    state: ForceStates,
    segments: Sequence[NDArray[np.intp]],
    inertia: float,
) -> tuple[Array, Array]:
    columns = term_columns(list(terms), *motion, inputs=state.inputs)
    by_parts = next((i for i, term in enumerate(terms) if term.id == INERTIA), None)
    rate, found, target = motion[1], [], []
    for part in segments:
        weights, slopes = _weights(part.size, 1.0 / state.sample_rate)
        integrals, accelerations = weights @ columns[part], slopes @ rate[part]
        if by_parts is not None:
            integrals[:, by_parts] = accelerations
        found.append(integrals)
        target.append(weights @ state.moment[part] - inertia * accelerations)
    return np.vstack(found), np.concatenate(target)


def _moving_segments(state: ForceStates) -> list[NDArray[np.intp]]:
    """Return the samples of each segment of one block in which the joint moves one way without a gap."""
    at = np.flatnonzero(state.moving)
    if not at.size:
        return []
    way, block = np.sign(state.rate[at]), state.block[at]
    ends = (np.diff(at) > 1) | (np.diff(way) != 0) | (np.diff(block) != 0)
    return np.split(at, np.flatnonzero(ends) + 1)
