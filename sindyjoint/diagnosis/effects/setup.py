"""What an effect acts on: the measured motion of a joint, or the setup of a simulated structure and where in it.

Columns of several motions are evaluated along all of them at once: a trial of nonlinear parameters costs a few hundred
steps of integration per run; a call of its own for each run would cost more than the steps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.mechanics.beam import Beam
from sindyjoint.mechanics.structure import Item, LumpedMass
from sindyjoint.numeric import Array


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
    kinds: dict[str, Setup] = field(default_factory=dict)

    @property
    def motion_key(self) -> tuple[Any, ...]:
        """What the motion depends on; setups that differ in their sensor only share it."""
        return (self.items, self.compliance, self.pulse, self.added, tuple(self.numbers.items()))

    @property
    def beams(self) -> list[Beam]:
        """The beams of the chain."""
        return [item for item in self.items if isinstance(item, Beam)]

    def with_beams(self, change: Callable[[Beam], Beam]) -> Setup:
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
    return [Way(act, 1.0, -most, 0.95 - most)] if setup.beams else []


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

    # At most nearly all of a mass is lost.
    return [
        Way(at(place), whole, -0.95 * mass / whole, name=str(place))
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


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """A run's motion as effects see it.

    Parameters
    ----------
    angle, rate, acceleration : ndarray, shape (n,)
        The whole motion: one period where ``repeats``, the record otherwise.
    step : float
        s between samples.
    time : ndarray, shape (n,)
        Since the start of the run, s; the mean over its periods where ``repeats``.
    frequency : float
        Hz; zero where the run has none.
    moment_rate, moment_slope : ndarray, shape (n,)
        dM/dt and ∂M/∂θ of the model along the motion.
    keep : ndarray of int, shape (m,)
        Samples in which the joint moves.
    repeats : bool
    began : float
        Start of the run since that of the campaign's first one, s.
    substeps : int
        Parts into which a step is cut where internal states are integrated.
    follow : int
        Internal states are integrated over every so-manieth sample and interpolated between.
    lead : tuple of two ndarray, shape (k,), optional
        Angle and rate before the first sample, at the same step: internal states begin with them.
    centre : float
        Angle from which sliders are brought to the first one, rad: a slider is in its middle there.
    inputs : mapping of str to ndarray, shape (n,)
        Declared inputs along the motion.
    """

    angle: Array
    rate: Array
    acceleration: Array
    step: float
    time: Array
    frequency: float
    moment_rate: Array
    moment_slope: Array
    keep: NDArray[np.intp]
    repeats: bool
    began: float = 0.0
    substeps: int = 1
    follow: int = 1
    lead: tuple[Array, Array] | None = None
    centre: float = 0.0
    inputs: Mapping[str, Array] = field(default_factory=dict)

    @cached_property
    def joined(self) -> JoinedMotions:
        """The motion as columns of an effect see it."""
        return JoinedMotions.of([self])

    def rough(self) -> MeasuredMotion:
        """Return the motion for searching: internal states are integrated in longer steps."""
        if self.substeps > 1:
            return replace(self, substeps=1)
        # While nonlinear parameters are searched, states follow a motion within a hundredth of its RMS.
        return replace(self, follow=max(1, int(1 / self.steps_to_follow(1e-2))))

    def steps_to_follow(self, error: float) -> float:
        """Return into how many parts a step is to be cut so that linear interpolation of the angle errs by so little.

        ``error`` is relative to the RMS of the angle; the answer is below one where steps may be longer.
        """
        bend = float(np.sqrt(np.mean(self.acceleration**2)))
        if bend == 0.0:
            # Along a path the angle is straight from reversal to reversal; no reversal may be passed over.
            return 1.0
        return self.step * float(np.sqrt(bend / (8 * error * max(float(np.std(self.angle)), 1e-300))))


@dataclass(frozen=True, eq=False)
class JoinedMotions:
    """Motions as columns of an effect see them.

    Parameters
    ----------
    signals : tuple of ndarray, shape (m,)
        At the kept samples of all motions: angle, rate, acceleration, frequency, time, time since the campaign began,
        moment rate and moment slope.
    angle, rate : ndarray, shape (n,)
        What internal states follow, by every so-manieth sample.
    ends : ndarray of int
        Where the followed samples of each motion end.
    timing : tuple of ndarray
        Per motion: s between followed samples, passes, parts of a step, state of a slider at its first sample.
    before : ndarray of int, shape (m,)
        The followed sample before each kept one.
    share : ndarray, shape (m,)
        Of the way from there to the next followed one.
    inputs : mapping of str to ndarray, shape (m,)
        Declared inputs at the kept samples of all motions.
    """

    signals: tuple[Array, ...]
    angle: Array
    rate: Array
    ends: NDArray[np.int64]
    timing: tuple[Array, NDArray[np.int64], NDArray[np.int64], Array]
    before: NDArray[np.intp]
    share: Array
    inputs: Mapping[str, Array] = field(default_factory=dict)

    @classmethod
    def of(cls, motions: Sequence[MeasuredMotion]) -> JoinedMotions:
        """Join motions."""
        kept = [
            [signal[m.keep] for signal in (m.angle, m.rate, m.acceleration)]
            + [np.full(m.keep.size, m.frequency), m.time[m.keep], m.began + m.time[m.keep]]
            + [m.moment_rate[m.keep], m.moment_slope[m.keep]]
            for m in motions
        ]
        leads = [_followed_lead(m) for m in motions]
        angles = [np.append(lead[0], m.angle[:: m.follow]) for lead, m in zip(leads, motions, strict=True)]
        rates = [np.append(lead[1], _followed_rate(m)) for lead, m in zip(leads, motions, strict=True)]
        ends = np.cumsum([angle.size for angle in angles])
        places = []
        for m, end in zip(motions, ends, strict=True):
            # Past the last followed sample its value holds.
            last = (m.angle.size - 1) // m.follow
            places.append(np.minimum(m.keep / m.follow, last) + (end - last - 1))
        place = np.concatenate(places)
        before = np.minimum(place.astype(np.intp), ends[-1] - 2)
        # A motion that repeats is run through until its states repeat, twenty times at most.
        return cls(
            signals=tuple(np.concatenate(parts) for parts in zip(*kept, strict=True)),
            angle=np.concatenate(angles),
            rate=np.concatenate(rates),
            ends=ends,
            timing=(
                np.array([m.step * m.follow for m in motions]),
                np.array([20 if m.repeats else 1 for m in motions]),
                np.array([m.substeps for m in motions]),
                np.array([angle[0] - m.centre for angle, m in zip(angles, motions, strict=True)]),
            ),
            before=before,
            share=place - before,
            inputs={
                name: np.concatenate([m.inputs[name][m.keep] for m in motions]) for name in motions[0].inputs
            },
        )

    def states(self, parameters: Array, limits: Array, program: tuple[Any, ...]) -> Array:
        """Return internal states at the kept samples, shape (n_states, m)."""
        from sindyjoint.equation.internal_states import integrate_runs

        integrate: Any = integrate_runs
        states = integrate(self.angle, self.rate, self.ends, self.timing, parameters, limits, program)
        here = states[:, self.before]
        # A state that no step can follow is infinite, and its column refused by whoever asked for it.
        with np.errstate(invalid="ignore"):
            return here + self.share * (states[:, self.before + 1] - here)


def _followed_lead(motion: MeasuredMotion) -> tuple[Array, Array]:
    if motion.lead is None:
        return np.empty(0), np.empty(0)
    # The last of them lies one followed step before the first sample of the motion.
    end = max(0, motion.lead[0].size - motion.follow + 1)
    angle, rate = (signal[:end][:: -motion.follow][::-1] for signal in motion.lead)
    return angle, rate


def _followed_rate(motion: MeasuredMotion) -> Array:
    rate = motion.rate[:: motion.follow]
    # What repeats comes back: the rest of a mean over samples would carry a slider away, pass by pass.
    return rate - rate.mean() if motion.repeats else rate
