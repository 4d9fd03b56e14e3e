"""The regression of terms as a scikit-learn regressor, and data frames in the order in which it reads columns."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from sindyjoint.discovery.regression import TermRegression
from sindyjoint.errors import InputError
from sindyjoint.inputs import input_names
from sindyjoint.numeric import Array

if TYPE_CHECKING:
    from sindyjoint.discovery.library import TermLibrary


class JointRegressor(RegressorMixin, BaseEstimator, TermRegression):
    """Sparse regression of a joint's moment on candidate terms of its state.

    Parameters
    ----------
    library : str, Path, Catalogue, feature library of pysindy, or sequence of these
        Candidate terms: names of shipped catalogues, paths of TOML files, catalogues, or libraries of features of
        (θ, θ̇).
    method : str or optimizer of pysindy
        How the path of models is made: ``"stlsq"`` (sequentially thresholded least squares on unique shares), any
        other of :data:`sindyjoint.discovery.methods.METHODS`, ``"pysindy:NAME"``, or an optimizer: of these the sets
        of terms that they pass through.
    selection : {"evidence", "one_standard_error"}
        How the threshold is chosen where ``threshold`` is None.
    threshold : float, optional
        Least unique share of a term's moment in the RMS of the whole; dimensionless. ``None``: chosen by evidence.
    significance : float
        Least ratio of coefficient to standard error.
    least_share : float
        Least unique share that ``selection="evidence"`` lets pass.
    forced : sequence of str
        Ids of terms that are never removed.
    forbidden : sequence of str
        Ids of terms that the library omits.
    signs : mapping of str to int, optional
        Id of a term to the sign, +1 or -1, that its coefficient must have: ``{"coulomb_friction": 1}``.
    fixed : mapping of str to float, optional
        Id of a term to its known coefficient, SI: it is in the model and not fitted.
    motion : {"rotation", "translation"}
        For the units of the coefficients.
    inputs : sequence of str or Input
        What else the moment may depend on: the last columns of X, or columns of a data frame by name. The dependences
        of the catalogue ``"inputs"`` join the candidates.
    cv : int, splitter of scikit-learn, or splits, optional
        Whose test sets are the groups where :meth:`fit` is given none.
    random_state : int, Generator or None
        Used by methods that resample.

    Attributes
    ----------
    model_ : JointModel
    coef_ : ndarray, shape (n_terms,)
        One per candidate, zero where it is not in the model; SI units.
    terms_ : tuple of ResolvedTerm
        The candidates.
    library_ : TermLibrary
        Of the candidates, fitted, in physical units: what ``found.sindy`` has as its feature library.
    indistinct_ : tuple of str
        Ids of candidates that were omitted because on these data they are combinations of the others.
    selected_ : tuple of str
        Ids of the terms in the model.
    selection_result_ : Selection
        The path of models, the chosen one and the reason.
    evidence_ : Evidence
        Factors of all runs and blocks: everything later analyses need of the samples. Without the fixed terms, whose
        part is taken from the target.
    least_share_ : float
        Least unique share that was let pass: the parameter's, or more where blocks share one estimate of the motion.
    reference_ : Reference
        Largest angle and rate of the data.
    inputs_ : tuple of Input
        With the range and the number of levels of the data.
    n_features_in_ : int

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> X = rng.uniform(-1, 1, (4000, 2)) * [8e-4, 0.02]
    >>> y = 6066 * X[:, 0] - 2.684e9 * X[:, 0] ** 3 + 1.867 * np.sign(X[:, 1]) + 0.01 * rng.normal(size=4000)
    >>> JointRegressor().fit(X, y).selected_
    ('linear_stiffness', 'cubic_stiffness', 'coulomb_friction')
    """

    def fit(
        self,
        X: Any,
        y: Any,
        groups: ArrayLike | None = None,
        sample_weight: ArrayLike | None = None,
        *,
        runs: ArrayLike | None = None,
        blocks: ArrayLike | None = None,
        X_replicate: ArrayLike | None = None,
        y_replicate: ArrayLike | None = None,
    ) -> JointRegressor:
        """Find the terms and their coefficients.

        Parameters
        ----------
        X : array_like, shape (n, 2 + k) or (n, 3 + k)
            Moving force states: θ rad, θ̇ rad/s and, to identify the inertia as a term, θ̈ rad/s²; then the k inputs.
            Rows of one run follow one another in time. Without inputs, columns from the fourth on are not used, with a
            warning.
        y : array_like, shape (n,)
            Transfer moment N·m, or with θ̈ in X the moment at the sensor.
        groups : array_like, shape (n,), optional
            What is held out together, usually the excitation frequency. Default: the test sets of ``cv``, or segments
            of consecutive rows.
        sample_weight : array_like, shape (n,), optional
            How often each row counts: one of weight two is a row that is there twice in succession.
        runs, blocks : array_like, shape (n,), optional
            Run of each row (default: its group) and replicate block within the run (default: segments of rows).
        X_replicate, y_replicate : array_like, shape (n, 2) or (n, 3) and (n,), optional
            The same rows from each single block. Their scatter carries the noise of the angle channel into
            the standard errors. Equal to X, they say that all blocks share one estimate of the motion: the scatter
            then lacks that noise, and ``selection="evidence"`` lets a term pass only if it carries 0.15 of the
            residual.

        Raises
        ------
        InputError
            For data or parameters that cannot be used.
        """
        self.check_parameters()
        names = input_names(self.inputs)
        X = ordered_frame(X, names)
        X, y = validate_data(self, X, y, dtype=np.float64, y_numeric=True, ensure_min_samples=2)
        given = X.shape[1]
        if given > 3 and not names:
            warnings.warn(
                f"X has {given} features; angle, rate and acceleration are used, the others are not: name them in "
                "`inputs` if the moment may depend on them",
                stacklevel=2,
            )
        labels = {"runs": runs, "blocks": blocks, "X_replicate": X_replicate, "y_replicate": y_replicate}
        super().fit(X if names else X[:, :3], y, groups, sample_weight, **labels)
        self.n_features_in_ = given
        return self

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        # The score that scikit-learn asks for is that of a target in ten columns, of which a force state has three.
        tags.regressor_tags.poor_score = True
        return tags

    @property
    def library_(self) -> TermLibrary:
        """The candidates, fitted, in physical units: what ``found.sindy`` has as its feature library."""
        from sindyjoint.discovery.library import TermLibrary

        return TermLibrary.of_regression(self)

    def predict(self, X: Any) -> Array:
        """Return the moment at force states, shape (n,), N·m."""
        check_is_fitted(self)
        X = ordered_frame(X, input_names(self.inputs))
        X = validate_data(self, X, dtype=np.float64, reset=False)
        return super().predict(X if self.inputs else X[:, :3])


# The position of what the name of a column speaks of: angle, rate, acceleration.
PLACES = {"angle": 0, "displacement": 0, "position": 0, "angular rate": 1, "velocity": 1, "acceleration": 2}


def ordered_frame(X: Any, inputs: Sequence[str]) -> Any:
    """Return a data frame with angle, rate and acceleration first and then the inputs, by name; an array as it is.

    Columns whose names say nothing are taken as they stand, as an array's are.

    Raises
    ------
    InputError
        For a frame that lacks an input, or of whose columns only some have names for another position.
    """
    from sindyjoint.files.drafting.survey import role_of

    columns = list(getattr(X, "columns", ()))
    names = [str(column) for column in columns]
    if not names:
        return X
    lacking = [name for name in inputs if name not in names]
    if lacking:
        raise InputError(f"X has the columns {', '.join(names)}; expected one for the input {lacking[0]!r}")
    motion = [column for column in columns if str(column) not in inputs]
    places = [PLACES.get(role_of(str(column), "") or "") for column in motion]
    known = [place for place in places if place is not None]
    if len(known) == len(motion) and sorted(known) == list(range(len(motion))):
        motion = [column for _, column in sorted(zip(known, motion, strict=True), key=lambda pair: pair[0])]
    elif any(place not in (None, at) for at, place in enumerate(places)):
        raise InputError(
            f"X has the columns {', '.join(names)}; expected angle, rate{', acceleration' * (len(motion) > 2)}: "
            "reorder them, or give an array"
        )
    return X[[*motion, *inputs]]
