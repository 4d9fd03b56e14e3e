"""An effect as a change of the setup of a simulated structure, with scaled numbers of order one that a fit can move."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from sindyjoint.diagnosis.effects.catalogue import Effect
from sindyjoint.diagnosis.effects.setup import PLACES, Scales, Setup
from sindyjoint.numeric import Array

# Points of a search over the nonlinear parameters, by their number.
GRID = {0: (), 1: (5,), 2: (3, 2), 3: (3, 1, 2)}


@dataclass(frozen=True, eq=False)
class Change:
    """One way in which one effect acts: numbers to which the response is proportional where small, then logarithms.

    Parameters
    ----------
    effect : Effect
    way : str
        Tells the ways of one effect apart.
    act : callable
        ``act(setup, values)`` returns the setup with the effect, of which ``values`` (SI) are the numbers.
    names : tuple of str
        Of the numbers.
    scales : ndarray, shape (k,)
        What one is of the first, linear ones, SI; at zero they do nothing.
    low, high : ndarray, shape (n,)
        Bounds of the scaled numbers, those of the nonlinear ones logarithms.
    units : dict of str to str
        Of the numbers by name.
    fallback : bool
        Whether it is tried only where no other way explains the gap.
    kind : str
        Of the joints in which it acts, where a structure has such kinds.
    """

    effect: Effect
    way: str
    act: Callable[[Setup, Array], Setup]
    names: tuple[str, ...]
    scales: Array
    low: Array
    high: Array
    units: dict[str, str] = field(default_factory=dict)
    fallback: bool = False
    kind: str = ""

    @property
    def size(self) -> int:
        """Numbers that a fit chooses."""
        return self.low.size

    @property
    def inside(self) -> bool:
        """Whether it acts in the joint."""
        return self.effect.enters not in PLACES

    @property
    def linear(self) -> range:
        """Places of the linear numbers."""
        return range(self.scales.size)

    @property
    def start(self) -> Array:
        """Numbers from which a fit begins: the effect does nothing there, where it can do nothing."""
        return np.append(np.zeros(self.scales.size), (0.5 * (self.low + self.high))[self.scales.size :])

    @property
    def grid(self) -> Array:
        """Starting points of a search, shape (m, n)."""
        low, high = self.low[self.scales.size :], self.high[self.scales.size :]
        shape = GRID.get(low.size, (2,) * low.size)
        axes = [a + (b - a) * (np.arange(n) + 0.5) / n for a, b, n in zip(low, high, shape, strict=True)]
        mesh = (
            np.array(np.meshgrid(*axes, indexing="ij")).reshape(low.size, -1).T if axes else np.zeros((1, 0))
        )
        return np.column_stack([np.zeros((len(mesh), self.scales.size)), mesh])

    def values(self, x: Array) -> Array:
        """Return scaled numbers in SI."""
        count = self.scales.size
        return np.append(self.scales * x[:count], np.exp(x[count:]))

    def apply(self, setup: Setup, x: Array) -> Setup:
        """Return the setup with the effect."""
        return self.act(setup, self.values(x))

    def report(self, x: Array) -> dict[str, float]:
        """Return the numbers by name, SI."""
        return dict(zip(self.names, map(float, self.values(x)), strict=True))


def structure_changes(effects: Sequence[Effect], setup: Setup, scales: Scales) -> tuple[Change, ...]:
    """Return the ways in which effects outside the joints can act on a setup."""
    return tuple(change for effect in effects for change in _ways(effect, setup, scales))


def _ways(effect: Effect, setup: Setup, scales: Scales) -> list[Change]:
    changes = []
    for way in PLACES[effect.enters](setup, scales):

        def act(setup: Setup, values: Array, change: Callable[[Setup, float], Setup] = way.act) -> Setup:
            return change(setup, float(values[0]))

        (number,) = effect.variants[0].parameters
        low, high = np.clip([number.lower, number.upper], way.least, way.most)
        changes.append(
            Change(
                effect, way.name, act, (number.name,), np.array([way.unit]), np.array([low]), np.array([high]),
                {number.name: number.unit},
            )
        )  # fmt: skip
    return changes
