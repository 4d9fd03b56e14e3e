"""Catalogues as pysindy feature libraries and scikit-learn transformers.

Importing this module imports pysindy; nothing else in the catalogue code does.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pysindy.feature_library.base import BaseFeatureLibrary, x_sequence_or_item
from pysindy.utils import AxesArray, comprehend_axes
from sklearn.utils.validation import check_is_fitted

from sindyjoint.discovery.regression import TermRegression
from sindyjoint.discovery.rows import state_columns
from sindyjoint.equation.candidates import catalogue_of, with_dependences
from sindyjoint.equation.catalogue import Catalogue, Reference, load_catalogue
from sindyjoint.errors import InputError
from sindyjoint.inputs import Input, input_names, reference_values, tested_inputs


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
        features = []
        for x in x_full:
            names = input_names(self.inputs)
            states = _states(x, len(names))
            if states.shape[1] != self.n_features_in_:
                raise InputError(
                    f"X has {states.shape[1]} columns; the library was fitted to {self.n_features_in_}"
                )
            columns = state_columns(self.terms_, states, names)
            columns /= self.scales_
            features.append(AxesArray(columns, comprehend_axes(columns)))
        return features

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
