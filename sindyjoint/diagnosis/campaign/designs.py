"""Tests that could be made: runs, as force states with the laboratory's noise, and a test that hides an effect.

Angles of several waveforms are prescribed. Where the campaign was driven by a moment, sinusoidal moments are among the
runs: the joint is then taken to move as it did at the nearest level, at another scale and frequency.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sindyjoint.diagnosis.campaign.change import LEAST_PERIODS
from sindyjoint.diagnosis.effects import load_effects, select_effects
from sindyjoint.diagnosis.effects.fitted import FittedEffect, effect_law
from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.equation.formula import compile_terms
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.equation.terms import Reference
from sindyjoint.inputs import constant
from sindyjoint.limits import STATES
from sindyjoint.mechanics import INTER_PANEL, Law
from sindyjoint.mechanics.excitation import TONES, Actuator, driven_at
from sindyjoint.mechanics.stickslip import transfer_moment
from sindyjoint.mechanics.virtual import LEVELS, virtual_campaign
from sindyjoint.numeric import RNG, Array
from sindyjoint.paper import FREQUENCIES
from sindyjoint.record import Campaign
from sindyjoint.response.drive import prescribed
from sindyjoint.states import ForceStates, NoiseFloor, moving_mask, rate_limit, reversal_guard

#: Waveforms of an angle in words, and what a plan calls them.
PLANNED: dict[str, str] = {
    "sinusoidal angle": "sine",
    "two-tone angle, sin(2*pi*f*t) + 0.8*sin(6*pi*f*t)": "two-tone-3",
    "two-tone angle, sin(2*pi*f*t) + 0.5*sin(10*pi*f*t)": "two-tone-5",
    "triangular angle, five odd harmonics": "triangle",
    "multisine angle, harmonics 1 to 5 alike": "multisine",
    "swept angle, from f to 5*f and back in each period": "sweep",
}
WAVEFORMS = {words: TONES[name] for words, name in PLANNED.items()}
#: What is asked for of a joint that a moment drives.
BY_MOMENT = "sinusoidal moment that moves the joint so far"
# Effects that a virtual test hides, and none.
CHOICES = (
    "amplitude_dependent_damping",
    "dead_zone",
    "position_dependent_friction",
    "dahl_friction",
    "maxwell_branch",
    "quadratic_damping",
    "jenkins_element",
    "nothing",
)


@dataclass(frozen=True)
class Design:
    """A run to be made.

    Parameters
    ----------
    frequency : float
        Hz.
    level : float
        Peak angle, rad.
    waveform : str
        A key of :data:`WAVEFORMS`, or :data:`BY_MOMENT`.
    series : tuple of (int, float, float), optional
        Order, cosine and sine of each harmonic of the angle; default: those of the waveform.
    duration : float
        s, at least; it lasts as long as the longest of the campaign, or four periods, in any case.
    """

    frequency: float
    level: float
    waveform: str
    series: tuple[tuple[int, float, float], ...] = ()
    duration: float = 0.0

    @property
    def harmonics(self) -> tuple[tuple[int, float, float], ...]:
        """Order, cosine and sine of each harmonic of the angle, at any scale."""
        return self.series or tuple((n, 0.0, a) for n, a in WAVEFORMS[self.waveform].items())

    @property
    def highest(self) -> float:
        """Frequency of the highest harmonic, Hz."""
        return self.frequency * max(order for order, *_ in self.harmonics)

    def motion(self, time: ArrayLike) -> tuple[Array, Array, Array]:
        """Return angle, rate and acceleration at some instants (s)."""
        phase = 2 * np.pi * np.arange(2000) / 2000
        shape = sum(c * np.cos(n * phase) + s * np.sin(n * phase) for n, c, s in self.harmonics)
        scale = self.level / np.max(np.abs(shape))
        t = np.asarray(time, dtype=np.float64)
        angle, rate, acceleration = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
        for order, cosine, sine in self.harmonics:
            w = 2 * np.pi * self.frequency * order
            in_phase, ahead = np.sin(w * t), np.cos(w * t)
            angle += scale * (sine * in_phase + cosine * ahead)
            rate += scale * w * (sine * ahead - cosine * in_phase)
            acceleration -= scale * w**2 * (sine * in_phase + cosine * ahead)
        return angle, rate, acceleration


def designs(
    states: Sequence[ForceStates], policy: DiagnosisPolicy = CAMPAIGN, actuator: Actuator | None = None
) -> tuple[Design, ...]:
    """Return the runs to choose from: from a tenth to four times the tested frequencies, up to the largest angle.

    With an actuator: over its band, every tone of them, and of what it prescribes alone.
    """
    tested = [s.frequency for s in states if s.frequency]
    if not tested:
        return ()
    middle = float(np.exp(np.mean(np.log(tested))))
    largest = max(_swing(s) for s in states)
    usual = tuple(f * middle for f in (0.1, 0.25, 0.5, 1.0, 2.0, 4.0))
    levels = [x * largest for x in (0.1, 0.2, 0.4, 0.7, 1.0)]

    def planned(lowest: float = 1.0, highest: float = 1.0) -> list[tuple[float, float]]:
        frequencies = usual if actuator is None else _over_band(actuator, lowest, highest)
        return [(float(f"{f:.3g}"), float(f"{x:.3g}")) for f, x in product(frequencies, levels)]

    driven = [s for s in states if s.frequency and not prescribed(s)]
    # How the joint sticks far below the levels tested is not known; and a run or two may be misjudged.
    least = min((policy.lowest_level * _swing(s) for s in driven), default=np.inf)
    if 2 * len(driven) < len(tested):
        least = np.inf
    duration = 0.0 if actuator is None else actuator.duration
    moments = [
        Design(f, x, BY_MOMENT, _series(min(driven, key=lambda s: abs(np.log(_swing(s) / x)))), duration)
        for f, x in planned()
        if x >= least
    ]
    if actuator is not None and actuator.drive == "moment":
        return tuple(moments)
    # Of nothing known of the actuator, the plainest four.
    words = [*PLANNED][: None if actuator is not None else 4]
    angles = [
        Design(f, x, each, duration=duration) for each in words for f, x in planned(*driven_at(PLANNED[each]))
    ]
    return tuple(angles) if actuator is not None else (*moments, *angles)


def _over_band(actuator: Actuator, lowest: float, highest: float) -> tuple[float, ...]:
    """Return six frequencies, Hz, of which these multiples lie in the actuator's band."""
    low, high = actuator.band[0] / lowest, actuator.band[1] / highest
    return tuple(dict.fromkeys(np.geomspace(low, high, 6).tolist())) if low <= high else ()


def within(design: Design, actuator: Actuator, model: JointModel) -> bool:
    """Return whether a run stays within the limits of an actuator, its moment by a model of terms."""
    angle, rate, acceleration = design.motion(np.arange(400) / (400 * design.frequency))
    columns = compile_terms([term.expression for term in model.terms])(angle, rate, acceleration)
    inertia = 0.0 if INERTIA in model else model.inertia
    moment = np.asarray(columns) @ model.coefficients + inertia * acceleration
    reached = {"angle": angle, "rate": rate, "moment": moment}
    # A tenth of each limit is left: what the sought effect adds is not in the model.
    return all(np.abs(values).max() <= 0.9 * getattr(actuator, name) for name, values in reached.items())


def _series(states: ForceStates) -> tuple[tuple[int, float, float], ...]:
    """Return the harmonics of a measured angle."""
    assert states.frequency is not None
    # Of a motion under a moment fifteen harmonics say enough.
    orders = np.arange(1, min(15, max(1, round(states.bandwidth / states.frequency))) + 1)
    phase = 2 * np.pi * states.frequency * np.outer(states.time, orders)
    basis = np.hstack([np.ones((states.time.size, 1)), np.cos(phase), np.sin(phase)])
    found = np.linalg.lstsq(basis, states.angle, rcond=None)[0][1:]
    return tuple((int(n), float(c), float(s)) for n, c, s in zip(orders, *np.split(found, 2), strict=True))


def expected_states(
    design: Design, states: Sequence[ForceStates], rate_share: float = STATES.periodic_rate_share
) -> ForceStates:
    """Return the force states that a run would have, its moment left at zero.

    It is as noisy as the one of the nearest level.
    """
    like = min(states, key=lambda s: abs(np.log(_swing(s) / design.level)))
    highest = design.highest
    # Forty samples in a period of the highest harmonic.
    sample_rate = max(like.sample_rate, 40 * highest)
    longest = max(s.n_samples / s.sample_rate for s in states)
    length = max(longest, LEAST_PERIODS / design.frequency, design.duration)
    periods = int(length * design.frequency + 1e-9)
    time = np.arange(round(periods / design.frequency * sample_rate)) / sample_rate
    # Reversals between samples, as anywhere in a record.
    angle, rate, acceleration = design.motion(time + 0.37 / sample_rate)
    # The standard error of a harmonic times its order's derivative, as in the periodic states.
    orders = 2 * np.pi * design.frequency * np.array([order for order, *_ in design.harmonics])
    error = np.sqrt(2 / time.size) * like.noise.angle
    noise = NoiseFloor(
        like.noise.moment,
        like.noise.angle,
        float(error * np.sqrt(np.sum(orders**2))),
        float(error * np.sqrt(np.sum(orders**4))),
    )
    guard = reversal_guard(sample_rate, design.frequency, highest)
    moving = moving_mask(rate, rate_limit(rate, noise.rate, rate_share), guard)
    return replace(
        like,
        run=f"advised {design.frequency:g} Hz {design.level:g} {design.waveform}",
        frequency=design.frequency,
        level=None,
        sample_rate=sample_rate,
        time=time,
        angle=angle,
        rate=rate,
        acceleration=acceleration,
        moment=np.zeros(time.size),
        moving=moving,
        block=np.zeros(time.size, dtype=np.intp),
        inputs={name: constant(float(np.mean(values)), time.size) for name, values in like.inputs.items()},
        replicate=None,
        noise=noise,
        method="periodic",
        bandwidth=highest,
        dropped=0.0,
        guard=guard,
        series=(),
    )


def _swing(states: ForceStates) -> float:
    return float(np.ptp(states.angle)) / 2


def hidden_campaign(rng: RNG = None) -> tuple[Campaign, str]:
    """Return a virtual test and the name of the effect, of 6 % of the moment's RMS, that the seed hid in it."""
    generator = np.random.default_rng(0 if rng is None else rng)
    name = str(generator.choice(CHOICES))
    peak = LEVELS[0] * INTER_PANEL.softening_angle
    law = None if name == "nothing" else hidden_law(name, INTER_PANEL, peak, FREQUENCIES, generator)
    campaign = virtual_campaign(INTER_PANEL, hidden=law, noise=0.01, rng=generator, duration=8.0)
    return campaign, name


def hidden_law(
    name: str,
    law: Law,
    peak: float,
    frequencies: Sequence[float],
    generator: np.random.Generator,
    share: float = 0.06,
) -> Any:
    """Return the law of an effect of a joint, with nonlinear parameters drawn within their bounds.

    Parameters
    ----------
    name : str
        Of the effect.
    law : Law
        The joint.
    peak : float
        Angle, rad, of the motion in which the effect has its share.
    frequencies : sequence of float
        Of that motion, Hz.
    generator : Generator
    share : float
        RMS of what the effect adds, of the moment's.
    """
    reference = Reference(peak, 2 * np.pi * max(frequencies) * peak)
    effect = select_effects(load_effects(), [name])[0]
    variant = effect.variants[0]
    bounds = np.log(variant.bounds(reference)).reshape(-1, 2)
    inner = np.exp(
        bounds[:, 0] + generator.uniform(0.4, 0.7, bounds.shape[0]) * np.diff(bounds, axis=1)[:, 0]
    )
    unit = FittedEffect(effect, variant, inner, np.ones(len(variant.columns)), 0.0)
    ours, whole = [], []
    for frequency in frequencies:
        time = np.arange(0, 3 / frequency, 2e-4)
        w = 2 * np.pi * frequency
        motion = peak * np.sin(w * time), peak * w * np.cos(w * time)
        ours.append(transfer_moment(effect_law([unit], frequency), *motion, 5000.0)[0])
        whole.append(transfer_moment(law, *motion, 5000.0)[0])
    size = share * np.std(np.concatenate(whole)) / np.std(np.concatenate(ours))
    return effect_law([FittedEffect(effect, variant, inner, np.full(len(variant.columns), size), 0.0)], 0.0)
