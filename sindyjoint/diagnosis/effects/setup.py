"""What a simulated structure is made of, and where in it an effect outside the joints may act."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any

from sindyjoint.mechanics.beam import Beam
from sindyjoint.mechanics.structure import Item, LumpedMass

# Shares of itself that a mass loses at most, and of one that a loss factor comes to.
MOST_LOST, MOST_LOSS = 0.95, 0.95


@dataclass(frozen=True, eq=False)
class Setup:
    """A test of a structure as it is simulated.

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
        Of the sensors: s, factor, m, m/s.
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
    kinds: "dict[str, Setup]" = field(default_factory=dict)

    @property
    def motion_key(self) -> tuple[Any, ...]:
        """What the motion depends on; setups that differ in their sensor only share it."""
        return (self.items, self.compliance, self.pulse, self.added, tuple(self.numbers.items()))

    @property
    def beams(self) -> list[Beam]:
        """The beams of the chain."""
        return [item for item in self.items if isinstance(item, Beam)]

    def with_beams(self, change: Callable[[Beam], Beam]) -> "Setup":
        """Return the setup with other beams."""
        return replace(self, items=tuple(change(i) if isinstance(i, Beam) else i for i in self.items))


@dataclass(frozen=True)
class Scales:
    """What the ranges of effects outside the joints are parts of.

    Parameters
    ----------
    period : float
        Of the main oscillation, s.
    displacement : float
        RMS of the record, m; zero where sensors see neither its zero nor its drift.
    duration : float
        s.
    """

    period: float
    displacement: float = 0.0
    duration: float = 1.0


@dataclass(frozen=True)
class Way:
    """One way in which an effect may act on a setup.

    Parameters
    ----------
    act : callable
        ``act(setup, value)`` returns the setup with the effect, of which ``value`` (SI) is the number.
    unit : float
        What the range of the catalogue is a part of, SI.
    least, most : float
        Between these parts it makes sense.
    name : str
        Tells the ways of one effect apart.
    """

    act: Callable[[Setup, float], Setup]
    unit: float = 1.0
    least: float = -inf
    most: float = inf
    name: str = ""


def _loss(setup: Setup, scales: Scales) -> list[Way]:
    def act(setup: Setup, value: float) -> Setup:
        return setup.with_beams(lambda b: replace(b, loss_factor=max(b.loss_factor + value, 0.0)))

    most = max((beam.loss_factor for beam in setup.beams), default=0.0)
    return [Way(act, 1.0, -most, MOST_LOSS - most)] if setup.beams else []


def _of_beams(name: str) -> Callable[[Setup, Scales], list[Way]]:
    def act(setup: Setup, value: float) -> Setup:
        return setup.with_beams(lambda b: replace(b, **{name: getattr(b, name) * (1 + value)}))

    return lambda setup, scales: [Way(act)] if setup.beams else []


def _point_mass(setup: Setup, scales: Scales) -> list[Way]:
    """Return the ways of a mass that is another, of each of the chain's, or of one at its tip where it has none."""
    whole = sum(i.mass_per_length * i.length if isinstance(i, Beam) else i.mass for i in setup.items)
    masses = {i: item.mass for i, item in enumerate(setup.items) if isinstance(item, LumpedMass)}

    def at(place: int) -> Callable[[Setup, float], Setup]:
        def act(setup: Setup, value: float) -> Setup:
            items = list(setup.items)
            if place < len(items):
                item = items[place]
                assert isinstance(item, LumpedMass)
                items[place] = replace(item, mass=item.mass + value)
            elif value != 0:
                items.append(LumpedMass("mass that the rig lacks", value))
            return replace(setup, items=tuple(items))

        return act

    return [
        Way(at(place), whole, -MOST_LOST * mass / whole, name=str(place))
        for place, mass in (masses or {len(setup.items): 0.0}).items()
        if setup.items
    ]


def _clamp(setup: Setup, scales: Scales) -> list[Way]:
    def act(setup: Setup, value: float) -> Setup:
        return replace(setup, compliance=max(setup.compliance + value, 0.0))

    units = [beam.length / beam.bending_stiffness for beam in setup.beams[:1]]
    return [Way(act, unit, -setup.compliance / unit) for unit in units]


def _scaled(name: str) -> Callable[[Setup, Scales], list[Way]]:
    def act(setup: Setup, value: float) -> Setup:
        return replace(setup, **{name: getattr(setup, name) * (1 + value)})

    return lambda setup, scales: [Way(act)]


def _shifted(name: str, unit: Callable[[Scales], float]) -> Callable[[Setup, Scales], list[Way]]:
    def act(setup: Setup, value: float) -> Setup:
        return replace(setup, **{name: getattr(setup, name) + value})

    return lambda setup, scales: [Way(act, unit(scales))] if unit(scales) else []


#: Where an effect outside the joints may act: each gives its ways in a setup, none where there is nothing to act on.
PLACES: dict[str, Callable[[Setup, Scales], list[Way]]] = {
    "loss factor": _loss,
    "bending stiffness": _of_beams("bending_stiffness"),
    "mass per length": _of_beams("mass_per_length"),
    "point mass": _point_mass,
    "clamp compliance": _clamp,
    "force scale": _scaled("pulse"),
    "sensor delay": _shifted("delay", lambda scales: scales.period),
    "sensor gain": _scaled("gain"),
    "sensor zero": _shifted("zero", lambda scales: scales.displacement),
    "sensor drift": _shifted("drift", lambda scales: scales.displacement / scales.duration),
}
