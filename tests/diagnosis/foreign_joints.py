"""Campaigns of joints integrated by SciPy: a referee that shares nothing with the package's own simulator.

A random joint (the paper's five terms, friction regularised) with one further law is driven by moments that do not
repeat, or carried through a motion. Runs are uneven in length and rate, sensors have zeros and noise.
"""

from dataclasses import dataclass, replace
from math import exp, pi, sin, tanh

import numpy as np
from scipy.integrate import solve_ivp

from sindyjoint.record import Campaign, Joint, Run
from tests.diagnosis.foreign_laws import CATALOGUE, CHANNELS, FOREIGN, SMALL

DRIVES = ("multisine", "sweep", "bursts", "swings", "cycles")
# Of the peak displacement, how closely a run must reach its level; and how often its drive is scaled to that.
WITHIN, TRIALS = 0.15, 5
# Beyond so many peak displacements a motion is given up: it softens without end.
FARTHEST = 3.0
# What the five terms cannot take over of a catalogue effect, in units of the noise: less is not to be seen.
VISIBLE = 3.0


class RunawayError(RuntimeError):
    """A joint that no drive holds within its range."""


@dataclass(frozen=True)
class ForeignJoint:
    """A joint: scales of its motion, coefficients of the five terms, a further law and its size."""

    name: str
    motion: str
    peak: float
    rate: float
    inertia: float
    k1: float
    k2: float
    k3: float
    c1: float
    friction: float
    states: int = 0
    law: object = None
    size: float = 0.0

    def moment(self, t, x, w, z):
        """Transfer moment, and the rates of the law's states."""
        own = ((self.k3 * x + self.k2) * x + self.k1) * x + self.c1 * w
        own += self.friction * tanh(w / (SMALL * self.rate))
        if self.law is None:
            return own, ()
        more, rates = self.law(t, x, w, z)
        return own + self.size * more, rates


@dataclass(frozen=True)
class ForeignCampaign:
    """A campaign, the joint that made it, and what was measured with what noise."""

    campaign: Campaign
    joint: ForeignJoint
    noise: float
    share: float
    drives: tuple


def foreign_campaign(name, seed):
    """Return the campaign of a joint with a law by name, ``"nothing"`` included.

    The size is a share of the moment's RMS: 0.1 to 1 of a law that no catalogue holds, and of an effect of the
    catalogue 0.05 to 0.3, but more where the five terms would take it over within three noises.
    """
    rng = np.random.default_rng((70_000, seed, _number(name)))
    joint = _joint(rng)
    noise = float(np.exp(rng.uniform(np.log(0.003), np.log(0.02))))
    runs = [_plan(rng, joint, index) for index in range(rng.integers(3, 5))]
    share = 0.0
    if name in FOREIGN or name in CATALOGUE:
        states, law = (FOREIGN.get(name) or CATALOGUE[name])(joint.peak, joint.rate, rng)
        foreign = name in FOREIGN
        share = float(np.exp(rng.uniform(np.log(0.1), 0.0)) if foreign else rng.uniform(0.05, 0.3))
        joint = replace(joint, name=name, states=states, law=law)
        joint, share = _sized(joint, runs[0], share, 0.0 if foreign else VISIBLE * noise)
    made = [_reaching(joint, each) for each in runs]
    zeros = rng.uniform(-1, 1, 2) * (rng.uniform() < 0.5)
    if name == "sensor_zero":
        zeros = rng.choice([-1.0, 1.0], 2) * [rng.uniform(0.5, 1.0), 0.0]
    delay = rng.uniform(0.8e-3, 2.5e-3) * rng.choice([-1.0, 1.0]) if name == "channel_delay" else 0.0
    recorded = [_recorded(rng, each, noise, zeros, delay, joint) for each in made]
    inertia = joint.inertia
    if name == "inertia_error":
        inertia += rng.uniform(1.5, 4.0) * VISIBLE * noise * _inertial_scale(made)
    campaign = Campaign(Joint(name="foreign", motion=joint.motion, inertia=inertia), tuple(recorded))
    return ForeignCampaign(campaign, joint, noise, share, tuple(each.drive for each in runs))


def _number(name):
    return (*FOREIGN, *CATALOGUE, *CHANNELS, "nothing").index(name)


def _joint(rng):
    """Draw a joint: displacement and stiffness over decades, a resonance above the drives."""
    motion = rng.choice(["rotation", "translation"])
    peak = float(np.exp(rng.uniform(np.log(5e-4), np.log(0.05))))
    k1 = float(np.exp(rng.uniform(np.log(50.0), np.log(5e4))))
    inertia = k1 / (2 * pi * rng.uniform(12.0, 40.0)) ** 2
    rate = 2 * pi * 3.0 * peak
    elastic = k1 * peak
    return ForeignJoint(
        "nothing", str(motion), peak, rate, inertia, k1,
        k2=rng.uniform(-0.1, 0.1) * elastic / peak**2,
        k3=rng.uniform(-0.12, 0.25) * elastic / peak**3,
        c1=rng.uniform(0.05, 0.25) * elastic / rate,
        friction=rng.uniform(0.05, 0.25) * elastic,
    )  # fmt: skip


@dataclass(frozen=True)
class Plan:
    """A run to be made: how it is driven, how long, at which rate, to which share of the peak."""

    name: str
    drive: str
    duration: float
    sample_rate: float
    level: float
    shape: object


def _plan(rng, joint, index):
    drive = str(rng.choice(DRIVES))
    duration = float(rng.uniform(3.0, 5.5))
    rate = float(rng.choice([360.0, 400.0, 500.0, 600.0]))
    level = float((1.0, 0.65, 0.95, 0.85)[index])
    return Plan(f"{drive}-{index}", drive, duration, rate, level, SHAPES[drive](rng, duration))


def _multisine(rng, duration):
    lines = [(2 * pi * f, rng.uniform(0, 2 * pi)) for f in rng.uniform(0.6, 6.0, 7)]
    return lambda t: sum(sin(w * t + p) for w, p in lines) * min(1.0, 2 * t) / 3


def _sweep(rng, duration):
    low, high = sorted(rng.uniform([0.5, 4.0], [1.2, 7.0]))
    if rng.uniform() < 0.5:
        low, high = high, low
    bend = (high - low) / (2 * duration)
    return lambda t: sin(2 * pi * (low + bend * t) * t) * min(1.0, 2 * t)


def _bursts(rng, duration):
    count = max(4, int(1.6 * duration))
    bursts = [
        (rng.uniform(0.2, duration), rng.uniform(0.15, 0.5), 2 * pi * rng.uniform(0.8, 6.0),
         rng.uniform(0, 2 * pi), rng.choice([-1, 1]) * rng.uniform(0.5, 1.0))
        for _ in range(count)
    ]  # fmt: skip
    return lambda t: sum(
        a * exp(-(((t - c) / d) ** 2)) * sin(w * t + p) for c, d, w, p, a in bursts if abs(t - c) < 4 * d
    )


# How long a pull takes to end, s.
LET_GO = 0.03
# How long a prescribed motion takes to begin, from rest, s.
BEGIN = 0.5


def _swings(rng, duration):
    """Pulls that are let go at once, again and again, by either side."""
    pulls, begin = [], 0.1
    while begin < duration:
        hold = rng.uniform(0.25, 0.6)
        pulls.append((begin, begin + hold, rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.0)))
        begin += hold + rng.uniform(0.3, 0.7)

    def shape(t):
        for start, end, size in pulls:
            if start <= t < end + LET_GO:
                rise = sin(0.5 * pi * min(1.0, (t - start) / (0.8 * (end - start)))) ** 2
                return size * rise * min(1.0, max(0.0, (end + LET_GO - t) / LET_GO))
        return 0.0

    return shape


def _cycles(rng, duration):
    """A prescribed motion: slow cycles of changing height, faster ones upon them; with two derivatives."""
    lines = [(2 * pi * rng.uniform(0.3, 0.8), rng.uniform(0, 2 * pi), 1.0)]
    lines += [
        (2 * pi * rng.uniform(1.0, 4.0), rng.uniform(0, 2 * pi), rng.uniform(0.2, 0.5)) for _ in range(3)
    ]
    lines = [(w, p, s / sum(each[2] for each in lines)) for w, p, s in lines]

    def motion(t):
        x = sum(s * np.sin(w * t + p) for w, p, s in lines)
        v = sum(s * w * np.cos(w * t + p) for w, p, s in lines)
        b = sum(-s * w**2 * np.sin(w * t + p) for w, p, s in lines)
        # It begins at rest: u rises from zero to one without a step of its second derivative.
        u = np.clip(t / BEGIN, 0.0, 1.0)
        rise = u**3 * (10 - 15 * u + 6 * u**2)
        slope = 30 * u**2 * (1 - u) ** 2 / BEGIN
        bend = 60 * u * (1 - u) * (1 - 2 * u) / BEGIN**2
        return x * rise, v * rise + x * slope, b * rise + 2 * v * slope + x * bend

    return motion


SHAPES = {"multisine": _multisine, "sweep": _sweep, "bursts": _bursts, "swings": _swings, "cycles": _cycles}


@dataclass(frozen=True)
class Motion:
    """A run before it is measured."""

    plan: Plan
    time: np.ndarray
    angle: np.ndarray
    rate: np.ndarray
    moment: np.ndarray
    states: np.ndarray


def _integrate(joint, plan, scale):
    """Return the motion of a joint under a plan's moment of size ``scale``, or along its motion of that size."""
    time = np.arange(round(plan.duration * plan.sample_rate)) / plan.sample_rate
    options = dict(t_eval=time, method="LSODA", rtol=1e-6, max_step=5e-3)
    if plan.drive == "cycles":
        return _carried(joint, plan, scale, time, options)

    def rates(t, y):
        moment, more = joint.moment(t, y[0], y[1], y[2:])
        return (y[1], (scale * plan.shape(t) - moment) / joint.inertia, *more)

    def away(t, y):
        return FARTHEST * joint.peak - abs(y[0])

    away.terminal = True
    atol = [1e-7 * joint.peak, 1e-6 * joint.rate, *[min(1e-7, 1e-6 * joint.peak)] * joint.states]
    begin = np.zeros(2 + joint.states)
    found = solve_ivp(rates, (0, plan.duration), begin, atol=atol, events=away, **options)
    if found.y.shape[1] != time.size:
        return None
    drive = scale * np.array([plan.shape(t) for t in time])
    return Motion(plan, time, found.y[0], found.y[1], drive, found.y[2:])


def _carried(joint, plan, scale, time, options):
    x, w, b = (scale * each for each in plan.shape(time))
    z = np.zeros((joint.states, time.size))
    if joint.states:

        def rates(t, y):
            at, speed, _ = plan.shape(t)
            return joint.moment(t, scale * at, scale * speed, y)[1]

        begin = np.zeros(joint.states)
        z = solve_ivp(rates, (0, plan.duration), begin, atol=min(1e-7, 1e-6 * joint.peak), **options).y
    moment = [joint.moment(t, x[i], w[i], z[:, i])[0] for i, t in enumerate(time)]
    return Motion(plan, time, x, w, np.array(moment) + joint.inertia * b, z)


def _reaching(joint, plan):
    """Return the motion under a drive that is scaled until the joint reaches its level."""
    goal = plan.level * joint.peak
    if plan.drive == "cycles":
        return _integrate(joint, plan, goal)
    scale = goal * joint.k1 + joint.friction + joint.size
    for _ in range(TRIALS):
        motion = _integrate(joint, plan, scale)
        reached = np.inf if motion is None else float(np.abs(motion.angle).max())
        if abs(reached / goal - 1) < WITHIN:
            break
        held = joint.friction
        scale = held + (scale - held) * float(np.clip(goal / max(reached, 1e-3 * goal), 0.4, 2.5))
    if motion is None:
        raise RunawayError(f"{joint.name}: no drive of {plan.drive} holds it")
    return motion


def _sized(joint, plan, share, least):
    """Return the joint with its further law scaled to a share of the moment, and that share.

    By a trial run of the joint with the law along, doing nothing. ``least`` is what the five terms must leave of it.
    """
    trial = _reaching(replace(joint, size=0.0), plan)
    along = zip(trial.time, trial.angle, trial.rate, trial.states.T, strict=True)
    unit = np.array([joint.law(*each)[0] for each in along])
    x, w = trial.angle, trial.rate
    sign = np.tanh(w / (SMALL * joint.rate))
    base = np.column_stack([np.ones_like(x), x, x**2, x**3, w, sign])
    base = base / np.linalg.norm(base, axis=0)
    left = unit - base @ np.linalg.lstsq(base, unit, rcond=None)[0]
    own = np.std([joint.moment(*each)[0] for each in zip(trial.time, x, w, trial.states.T, strict=True)])
    size = max(share * own / np.std(unit), least * own / np.sqrt(np.mean(left**2)))
    return replace(joint, size=float(size)), float(size * np.std(unit) / own)


def _inertial_scale(made):
    """The inertia that would carry as much moment as the joint does, kg·m²."""
    bend = np.concatenate([np.gradient(each.rate, each.time) for each in made])
    moment = np.concatenate([each.moment for each in made])
    return float(np.std(moment) / np.std(bend))


def _recorded(rng, motion, noise, zeros, delay, joint):
    """Return a run as sensors record it: with their zeros, white noise, and the moment late by ``delay``."""
    moment = np.interp(motion.time - delay, motion.time, motion.moment) if delay else motion.moment
    channels = [
        signal + zero + noise * np.std(signal) * rng.standard_normal(signal.size)
        for signal, zero in (
            (moment, 0.03 * zeros[1] * joint.k1 * joint.peak),
            (motion.angle, 0.08 * zeros[0] * joint.peak),
        )
    ]
    return Run(motion.plan.name, *channels, motion.plan.sample_rate, level=f"{motion.plan.level:g}")
