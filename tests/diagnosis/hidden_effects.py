"""Virtual tests with an effect hidden in them, made with the simulator alone: the referee of diagnosis.

No code of discovery or discrepancy is used. An effect is added to a random joint's law (or to its channels) at a given
share of the moment's RMS.
"""

from dataclasses import dataclass, replace

import numpy as np

from sindyjoint.mechanics import FunctionLaw, SumLaw, transfer_moment
from sindyjoint.record import Campaign
from tests.diagnosis.hidden_laws import LAWS
from tests.recovery.random_joints import aperiodic_campaign, random_plan

CHANNELS = (
    "channel_delay",
    "angle_offset",
    "moment_drift",
    "angle_drift",
    "inertia_error",
    "frequency_dependent_stiffness",
    "stiffness_drift",
    "clipping",
    "pick_up",
)
# In no catalogue. What does not repeat (a stiffness that breathes, mains pick-up) may also pass for noise.
OUTSIDE = (
    "ripple", "second_resonance", "friction_ripple", "stiffness_jump", "rate_squared_stiffness", "friction_lag",
    "relay", "breathing_stiffness", "clipping", "pick_up",
)  # fmt: skip


@dataclass(frozen=True)
class Hidden:
    """A campaign and what is hidden in it."""

    name: str
    size: float
    campaign: Campaign
    plan: object
    parameters: tuple


def hide(name, seed, size=0.06, noise=0.01, **fixed):
    """Return a random joint's virtual test in which an effect carries ``size`` of the moment's RMS.

    Two names joined by ``+`` hide two effects of that size each; the second may be one of the channels.
    """
    generator = np.random.default_rng(50_000 + seed)
    fixed = {"drive": ("moment", "displacement")[seed % 2], "sample_rate": 1000.0, "duration": 8.0, **fixed}
    plan = random_plan(seed, **fixed)
    if name == "nothing":
        return Hidden(name, 0.0, plan.campaign(noise), plan, ())
    first, _, second = name.partition("+")
    if first in CHANNELS or first in DRIFTS:
        return _in_channels(first, plan, size, noise, generator)
    law = _law(first, plan, size, generator)
    if not second:
        return Hidden(name, size, plan.campaign(noise, hidden=law), plan, law.parameters)
    if second in CHANNELS:
        return replace(_in_channels(second, plan, size, noise, generator, law), name=name)
    both = SumLaw(law, _law(second, plan, size, generator))
    return Hidden(name, size, plan.campaign(noise, hidden=both), plan, law.parameters)


def hide_in_noise(name, kind, seed, size=0.06, noise=0.01):
    """Return the same under moments that do not repeat, ``"multisine"`` or ``"sweep"``; no effect of a channel."""
    plan = random_plan(seed, drive="moment", sample_rate=1000.0)
    law = None if name == "nothing" else _law(name, plan, size, np.random.default_rng(50_000 + seed))
    campaign = aperiodic_campaign(plan, noise, kind, hidden=law)
    return Hidden(name, size if law else 0.0, campaign, plan, law.parameters if law else ())


def _law(name, plan, size, generator):
    """The law of an effect with drawn inner parameters, scaled to its share of the moment's RMS."""
    function, states, draw = LAWS[name]
    peak, rate = _peaks(plan)
    inner = tuple(map(float, draw(peak, rate, generator)))
    unit, base = _rms(plan, FunctionLaw(function, (1.0, *inner), states))
    return FunctionLaw(function, (size * base / unit, *inner), states)


def _peaks(plan):
    peak = max(plan.levels) * plan.law.softening_angle
    return peak, 2 * np.pi * max(plan.frequencies) * peak


def _rms(plan, law):
    """RMS of a law's moment and of the joint's, over sinusoids of the plan, both less their mean."""
    ours, whole = [], []
    for frequency in plan.frequencies:
        for level in plan.levels:
            time = np.arange(0, 4 / frequency, 1e-4)
            amplitude, w = level * plan.law.softening_angle, 2 * np.pi * frequency
            angle, rate = amplitude * np.sin(w * time), amplitude * w * np.cos(w * time)
            late = time > 2 / frequency
            ours.append(transfer_moment(law, angle, rate, 1e4)[0][late])
            whole.append(transfer_moment(plan.law, angle, rate, 1e4)[0][late])
    return float(np.sqrt(np.mean(np.concatenate(ours) ** 2))), float(
        np.sqrt(np.mean(np.concatenate(whole) ** 2))
    )


def _in_channels(name, plan, size, noise, generator, law=None):
    """What the channels (or the runs) do, beside an effect of the joint itself where ``law`` is one."""
    sign = generator.choice([-1.0, 1.0])
    _, rms = _rms(plan, plan.law)
    clean = plan.campaign(0.0, hidden=law)
    amount = 0.0
    if name == "channel_delay":
        slope = np.sqrt(
            np.mean(np.concatenate([np.gradient(r.moment) * r.sample_rate for r in clean.runs]) ** 2)
        )
        amount = float(np.clip(size * rms / slope, 0.0, 4e-3))
        clean = plan.campaign(0.0, hidden=law, skew=sign * amount)
    elif name == "angle_offset":
        amount = size * rms / plan.law.k1
        clean = plan.campaign(0.0, hidden=law, angle_offset=sign * amount)
    elif name == "clipping":
        amount = _clip_level(clean.runs, size)
    elif name == "pick_up":
        amount = size * rms * np.sqrt(2) / np.sqrt(np.mean([np.mean(r.angle**2) for r in clean.runs]))
    elif name == "inertia_error":
        peak, _ = _peaks(plan)
        amount = size * rms / (0.7 * peak * (2 * np.pi * np.mean(plan.frequencies)) ** 2)
        joint = replace(clean.joint, inertia=plan.law.inertia + amount)
        clean = replace(clean, joint=joint)
    elif name == "frequency_dependent_stiffness":
        peak, _ = _peaks(plan)
        amount = sign * size * rms / (0.5 * peak * np.std(plan.frequencies))
        runs = []
        for frequency in plan.frequencies:
            part = replace(plan, frequencies=(frequency,))
            law = FunctionLaw(_stiffness, (amount * (frequency - np.mean(plan.frequencies)),))
            runs += part.campaign(0.0, hidden=law).runs
        clean = replace(clean, runs=tuple(runs))
    elif name in DRIFTS:
        clean, amount = _drifting(name, plan, size * rms * sign)
        sign = 1.0
    runs = []
    for run in clean.runs:
        ramp = np.linspace(0, 2 * np.sqrt(3.0), run.n_samples) * size * rms * sign
        moment, angle = run.moment, run.angle
        if name == "moment_drift":
            moment = moment + ramp
        elif name == "angle_drift":
            angle = angle + ramp / plan.law.k1
        elif name == "clipping":
            moment = np.clip(moment, -amount, amount)
        elif name == "pick_up":
            moment = moment + amount * angle * np.sin(2 * np.pi * MAINS * run.time)
        moment = moment + noise * np.std(run.moment) * generator.standard_normal(run.n_samples)
        angle = angle + noise * np.std(run.angle) * generator.standard_normal(run.n_samples)
        runs.append(replace(run, moment=moment, angle=angle))
    return Hidden(name, size, replace(clean, runs=tuple(runs)), plan, (float(sign * amount),))


MAINS = 50.0  # Hz


def _clip_level(runs, size):
    """The moment at which a sensor must stop so that what it loses has that share of the RMS of all runs."""
    moment = np.concatenate([run.moment for run in runs])
    rms = float(np.sqrt(np.mean(moment**2)))
    low, high = 0.0, float(np.abs(moment).max())
    for _ in range(50):
        middle = 0.5 * (low + high)
        lost = np.sqrt(np.mean(np.maximum(np.abs(moment) - middle, 0.0) ** 2))
        low, high = (middle, high) if lost > size * rms else (low, middle)
    return high


def law_at(hidden, frequency):
    """The law beside the joint's own at a frequency; None where a channel is at fault. Drifts have none."""
    name, plan = hidden.name, hidden.plan
    if name in LAWS:
        function, states, _ = LAWS[name]
        return FunctionLaw(function, hidden.parameters, states)
    if name == "frequency_dependent_stiffness":
        return FunctionLaw(_stiffness, (hidden.parameters[0] * (frequency - np.mean(plan.frequencies)),))
    if name not in ("channel_delay", "angle_offset", "inertia_error", "nothing"):
        raise ValueError(f"no further run is made of {name}")
    return None


def _stiffness(theta, omega, direction, state, p, out):
    out[0] = p[0] * theta


def _warming(theta, omega, direction, state, p, out):
    """Stiffness that grows with time from p[1] on; the state is a clock."""
    out[0] = p[0] * (state[0] - p[1]) * theta
    out[1] = 1.0


def _jump(theta, omega, direction, state, p, out):
    """Stiffness that jumps by p[0] at p[1], half of it on either side of what it was."""
    out[0] = p[0] * (0.5 if state[0] > p[1] else -0.5) * theta
    out[1] = 1.0


# How a stiffness changes in time: along each run alike, from run to run as well, or at once in the middle of each run.
DRIFTS = ("stiffness_drift", "stiffness_drift_on", "stiffness_jump")


def _drifting(name, plan, moment):
    """Return the noiseless campaign in which the stiffness carries ``moment`` RMS of change, and the change."""
    # What softens under a moment swings further: such a joint is tested further from its limit.
    if plan.drive != "displacement":
        plan = replace(plan, levels=tuple(0.6 * level for level in plan.levels))
    peak, _ = _peaks(plan)
    swing = peak * np.sqrt(np.mean(np.square(plan.levels)) / 2) / max(plan.levels)
    total = (
        len(plan.frequencies) * len(plan.levels) * plan.duration if name.endswith("_on") else plan.duration
    )
    amount = 2 * moment / swing if name == "stiffness_jump" else moment / swing * np.sqrt(12) / total
    runs, began = [], 0.0
    for frequency in plan.frequencies:
        for level in plan.levels:
            middle = total / 2 - began
            law = FunctionLaw(_jump if name == "stiffness_jump" else _warming, (amount, middle), 1)
            part = replace(plan, frequencies=(frequency,), levels=(level,))
            runs += part.campaign(0.0, hidden=law).runs
            began += plan.duration if name.endswith("_on") else 0.0
    return plan.campaign(0.0).with_runs(tuple(runs)), amount
