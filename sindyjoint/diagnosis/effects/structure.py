"""What a simulated structure may be missing: each candidate changes a setup, in its joint, beside it, or in its sensor.

A :class:`Setup` is everything that a simulation of a pulse test needs. A :class:`Change` is one way in which one effect
may act on it, with scaled numbers of order one that a fit can move.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

from sindyjoint.diagnosis.effects.catalogue import read_entries
from sindyjoint.equation.catalogue_file import Identifier, Line, StrictEntry, library_folder
from sindyjoint.errors import InputError
from sindyjoint.mechanics.beam import Beam
from sindyjoint.mechanics.structure import Item, LumpedMass
from sindyjoint.numeric import Array

ActsOn = Literal[
    "loss factor", "bending stiffness", "mass per length", "point mass", "clamp compliance", "force scale",
    "sensor delay", "sensor gain", "sensor zero", "sensor drift",
]  # fmt: skip


class _Entry(StrictEntry):
    id: Identifier
    name: Line
    family: Line
    meaning: Line
    confused_with: list[Identifier] = []
    acts_on: ActsOn
    symbol: Line
    unit: Line
    lower: float
    upper: float


class _File(StrictEntry):
    name: Line
    description: Line
    effect: list[_Entry]


@dataclass(frozen=True)
class StructureEffect:
    """An effect outside the joint, as the catalogue gives it."""

    id: str
    name: str
    family: str
    meaning: str
    confused_with: tuple[str, ...]
    acts_on: ActsOn
    symbol: str
    unit: str
    lower: float
    upper: float


@dataclass(frozen=True, eq=False)
class Setup:
    """A pulse test as it is simulated.

    Parameters
    ----------
    items : tuple of Beam, Hinge, LumpedMass
    compliance : float
        Of the clamp, rad/(N·m); zero for a rigid one.
    numbers : dict of str to float
        Parameters of the joint's law.
    added : tuple of str
        Keys of the laws added to the joint, in order.
    pulse : float
        Factor on the force.
    delay, gain, zero, drift : float
        Of the displacement record: s, factor, m, m/s.
    kinds : dict of str to Setup
        Of a structure with several kinds of joints: numbers and added laws of each.
    """

    items: tuple[Item, ...]
    compliance: float
    numbers: dict[str, float]
    added: tuple[str, ...] = ()
    pulse: float = 1.0
    delay: float = 0.0
    gain: float = 1.0
    zero: float = 0.0
    drift: float = 0.0
    kinds: dict[str, Setup] = field(default_factory=dict)

    @property
    def motion_key(self) -> tuple[Any, ...]:
        """What the motion depends on; setups that differ in their sensor only share it."""
        return (self.items, self.compliance, self.pulse, self.added, tuple(self.numbers.items()))


@dataclass(frozen=True, eq=False)
class Change:
    """One way in which one effect acts.

    Parameters
    ----------
    effect, family : str
        The effect's id and family.
    way : str
        Tells the ways of one effect apart.
    apply : callable
        ``apply(setup, x)`` returns the setup with the effect.
    start, low, high : ndarray, shape (n,)
        Of the scaled numbers; at ``start`` the effect does nothing, where it can do nothing.
    grid : ndarray, shape (m, n)
        Starting points of a search: one row, `start`, for an effect without nonlinear parameters.
    linear : tuple of int
        Places of the numbers to which the response is proportional where they are small.
    report : callable
        ``report(x)`` returns the numbers by name, SI.
    inside : bool
        Whether it acts in the joint.
    memory : bool
        Whether it remembers.
    fallback : bool
        Whether it is tried only where no other variant explains the gap.
    units : dict of str to str
        Of the reported numbers.
    kind : str
        Of the joints in which it acts, where a structure has such kinds.
    """

    effect: str
    family: str
    way: str
    apply: Callable[[Setup, Array], Setup]
    start: Array
    low: Array
    high: Array
    grid: Array
    linear: tuple[int, ...]
    report: Callable[[Array], dict[str, float]]
    inside: bool = False
    memory: bool = False
    fallback: bool = False
    units: dict[str, str] = field(default_factory=dict)
    kind: str = ""

    @property
    def size(self) -> int:
        """Numbers that a fit chooses."""
        return self.start.size


@lru_cache(maxsize=8)
def load_structure_effects(path: Path | None = None) -> tuple[StructureEffect, ...]:
    """Return the shipped effects outside the joint, or those of a file.

    Raises
    ------
    MissingInputError, InputError
        The message names file, effect and field.
    """
    path = library_folder() / "structure" / "effects.toml" if path is None else path
    entry = read_entries(path, _File)
    for each in entry.effect:
        if not each.lower < each.upper:
            raise InputError(
                f"{path.name}: effect {each.id!r}: lower {each.lower:g} is not below upper {each.upper:g}"
            )
    return tuple(
        StructureEffect(**{**each.model_dump(), "confused_with": tuple(each.confused_with)})
        for each in entry.effect
    )


@dataclass(frozen=True)
class Scales:
    """What the numbers of effects outside the joint are parts of.

    Parameters
    ----------
    period : float
        Of the main oscillation, s.
    displacement : float
        RMS of the record, m.
    duration : float
        s.
    """

    period: float
    displacement: float
    duration: float


def structure_changes(effects: Sequence[StructureEffect], setup: Setup, scales: Scales) -> tuple[Change, ...]:
    """Return the ways in which effects outside the joint can act on a setup."""
    return tuple(change for effect in effects for change in _ways(effect, setup, scales))


def _ways(effect: StructureEffect, setup: Setup, scales: Scales) -> list[Change]:
    low, high = effect.lower, effect.upper
    if effect.acts_on == "point mass":
        whole = chain_mass(setup.items)
        places = [i for i, item in enumerate(setup.items) if isinstance(item, LumpedMass)]
        ways = []
        for place in places or [len(setup.items)]:
            own = setup.items[place].mass if place < len(setup.items) else 0.0  # type: ignore[union-attr]
            floor = max(low, -0.95 * own / whole)
            ways.append(_change(effect, str(place), _add_mass(place, whole), whole, floor, high))
        return ways
    if effect.acts_on == "clamp compliance":
        first = next(item for item in setup.items if isinstance(item, Beam))
        unit = first.length / first.bending_stiffness
        return [_change(effect, "", _soften(unit), unit, max(low, -setup.compliance / unit), high)]
    if effect.acts_on == "loss factor":
        most = max(item.loss_factor for item in setup.items if isinstance(item, Beam))
        return [_change(effect, "", _lose, 1.0, max(low, -most), min(high, 0.95 - most))]
    act, unit = {
        "bending stiffness": (_scale_beams("bending_stiffness"), 1.0),
        "mass per length": (_scale_beams("mass_per_length"), 1.0),
        "force scale": (lambda s, x: replace(s, pulse=s.pulse * (1 + x)), 1.0),
        "sensor delay": (lambda s, x: replace(s, delay=s.delay + x * scales.period), scales.period),
        "sensor gain": (lambda s, x: replace(s, gain=s.gain * (1 + x)), 1.0),
        "sensor zero": (lambda s, x: replace(s, zero=s.zero + x * scales.displacement), scales.displacement),
        "sensor drift": (
            lambda s, x: replace(s, drift=s.drift + x * scales.displacement / scales.duration),
            scales.displacement / scales.duration,
        ),
    }[effect.acts_on]
    return [_change(effect, "", act, unit, low, high)]


def _change(
    effect: StructureEffect, way: str, act: Callable[[Setup, float], Setup], unit: float, low: float, high: float
) -> Change:  # fmt: skip
    start = np.zeros(1)
    return Change(
        effect.id, effect.family, way, lambda setup, x: act(setup, float(x[0])), start,
        np.array([low]), np.array([high]), start[None], (0,), lambda x: {effect.symbol: float(x[0]) * unit},
        units={effect.symbol: effect.unit},
    )  # fmt: skip


def chain_mass(items: Sequence[Item]) -> float:
    """Return the mass of a whole chain, kg."""
    return sum(i.mass_per_length * i.length if isinstance(i, Beam) else i.mass for i in items)


def _lose(setup: Setup, x: float) -> Setup:
    return _with_beams(setup, lambda beam: replace(beam, loss_factor=max(beam.loss_factor + x, 0.0)))


def _scale_beams(name: str) -> Callable[[Setup, float], Setup]:
    def act(setup: Setup, x: float) -> Setup:
        return _with_beams(setup, lambda beam: replace(beam, **{name: getattr(beam, name) * (1 + x)}))

    return act


def _with_beams(setup: Setup, change: Callable[[Beam], Beam]) -> Setup:
    return replace(setup, items=tuple(change(i) if isinstance(i, Beam) else i for i in setup.items))


def _add_mass(place: int, whole: float) -> Callable[[Setup, float], Setup]:
    def act(setup: Setup, x: float) -> Setup:
        items = list(setup.items)
        if place < len(items):
            item = items[place]
            assert isinstance(item, LumpedMass)
            items[place] = replace(item, mass=item.mass + x * whole)
        elif x != 0:
            items.append(LumpedMass("mass that the rig lacks", x * whole))
        return replace(setup, items=tuple(items))

    return act


def _soften(unit: float) -> Callable[[Setup, float], Setup]:
    return lambda setup, x: replace(setup, compliance=max(setup.compliance + x * unit, 0.0))
