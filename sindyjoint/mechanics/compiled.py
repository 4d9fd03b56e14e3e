"""A compiled law, as integrators take it; light, for what compiles laws imports numba."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: ``f(theta, omega, direction, state, parameters, out)`` on scalars: writes the moment to ``out[0]`` and the rates
#: of the internal states to ``out[1:]``. It must be compilable by numba.
ScalarLaw = Callable[[float, float, float, Any, Any, Any], None]


@dataclass(frozen=True)
class CompiledLaw:
    """A law as the integrators call it: a C function and the numbers it reads.

    Parameters
    ----------
    function : object
        The compiled ``numba`` function that others may compose; takes arrays.
    callback : object
        The C callback made of it. Held here so that its address stays valid.
    parameters : ndarray, shape (n_parameters,)
    n_states : int
    """

    function: Any
    callback: Any
    parameters: Array
    n_states: int

    @property
    def address(self) -> int:
        """Address of the C function."""
        return self.callback.address
