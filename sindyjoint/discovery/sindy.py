"""A discovered joint in the clothes of pysindy: print, equations, coefficients, predict, score, simulate."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pysindy import SINDy

from sindyjoint.discovery.library import TermLibrary
from sindyjoint.discovery.optimizer import UniqueShareSTLSQ
from sindyjoint.discovery.regression import TermRegression
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError
from sindyjoint.numeric import Array

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
