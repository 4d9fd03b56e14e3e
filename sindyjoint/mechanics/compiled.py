"""A compiled law, as integrators take it; light, for what compiles laws imports numba."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array

#: ``f(theta, omega, direction, state, parameters, out)`` on scalars: writes the moment to ``out[0]`` and the rates
#: of the internal states to ``out[1:]``. It must be compilable by numba.
ScalarLaw = Callable[[float, float, float, Any, Any, Any], None]


@dataclass(frozen=True)
class CompiledLaw:
    """A law as the integrators call it: a C function and the numbers it reads.

    Parameters
    ----------
    callback : object
        The C callback. Held here so that its address stays valid.
    numbers : ndarray
        What the function reads: the law's parameters, and what a general function needs to know of a law beside them.
    n_states : int
    own : ndarray of int, optional
        Where among the numbers the law's parameters stand. Default: all are parameters.
    parts : tuple of CompiledLaw
        Laws whose functions it calls, for they must stay, too.
    """

    callback: Any
    numbers: Array
    n_states: int
    own: NDArray[np.int64] | None = None
    parts: tuple[CompiledLaw, ...] = ()

    @property
    def address(self) -> int:
        """Address of the C function."""
        return self.callback.address

    @property
    def places(self) -> NDArray[np.int64]:
        """Where the law's parameters stand among the numbers."""
        return np.arange(self.numbers.size) if self.own is None else self.own

    @property
    def parameters(self) -> Array:
        """Parameters of the law, in its order."""
        return self.numbers[self.places]
