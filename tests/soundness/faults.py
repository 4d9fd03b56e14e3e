"""Faults that data can show, put into sound campaigns of random joints: the referee of the check.

Nothing of the check itself is used. Each fault has a size that moves a coefficient by more than its interval, and the
ids by which it counts as found.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, lfilter

import sindyjoint
from tests.recovery.random_joints import random_plan


def sound_campaign(seed):
    """Return the virtual test of a random joint with noise of 0.1 to 2 % of both channels."""
    noise = 10 ** np.random.default_rng((77, seed)).uniform(-3, -1.7)
    rate = (500.0, 1000.0, 2000.0)[seed % 3] if seed % 2 else 1000.0
    return random_plan(seed, sample_rate=rate, duration=8.0).campaign(float(noise))


@dataclass(frozen=True)
class Fault:
    """How a fault is put in: of some runs (drawn) or of all, and how it must be called."""

    change: Callable
    ids: tuple
    runs: str = "one"  # "one", "all", or "campaign", where the change takes them all at once
    severities: tuple = ("stops", "biases")


def inject(kind, campaign, seed):
    """Return a campaign with a fault, and the name of the run that has it (None: the campaign)."""
    fault, rng = FAULTS[kind], np.random.default_rng((31, seed, *kind.encode()))
    runs = list(campaign.runs)
    if fault.runs == "campaign":
        return fault.change(campaign, rng), None
    if fault.runs == "all":
        state = rng.bit_generator.state
        for i, run in enumerate(runs):
            rng.bit_generator.state = state  # one amplifier, one setting
            runs[i] = fault.change(run, rng)
        return campaign.with_runs(tuple(runs)), None
    i = int(rng.integers(len(runs)))
    runs[i] = fault.change(runs[i], rng)
    return campaign.with_runs(tuple(runs)), runs[i].name


def found(kind, findings, run):
    """Return whether a fault is among the findings, under its name and with its run."""
    fault = FAULTS[kind]
    return any(
        f.id in fault.ids and f.severity in fault.severities and (run is None or f.run in (run, None))
        for f in findings
    )


def of(channel):
    """Turn a change of an array into one of that channel of a run."""

    def decorate(change):
        return lambda run, rng: replace(run, **{channel: change(getattr(run, channel).copy(), run, rng)})

    return decorate


def clipped(top, bottom):
    def change(x, run, rng):
        middle, half = 0.5 * (x.max() + x.min()), 0.5 * np.ptp(x)
        return np.clip(x, middle - bottom * half, middle + top * half)

    return change


def spikes(count, size):
    def change(x, run, rng):
        at = rng.choice(x.size - 20, count, replace=False) + 10
        x[at] += size * np.std(x) * rng.choice([-1, 1], count) * rng.uniform(0.7, 1.3, count)
        return x

    return change


def dropouts(count, length, zero):
    def change(x, run, rng):
        for at in rng.integers(50, x.size - 4 * length, count):
            x[at : at + length] = 0.0 if zero else x[at]
        return x

    return change


def frozen(share):
    def change(x, run, rng):
        at, length = int(rng.uniform(0.3, 0.6) * x.size), int(share * x.size)
        x[at : at + length] = x[at]
        return x

    return change


def dead(x, run, rng):
    return np.full(x.size, np.mean(x[:5]))


def lost(run, rng):
    """Both channels lack some samples in the middle."""
    per = run.sample_rate / run.frequency
    at, count = int(rng.uniform(0.4, 0.6) * run.n_samples), int(rng.uniform(0.06, 0.6) * per)
    return replace(
        run, **{n: np.delete(getattr(run, n), np.arange(at, at + count)) for n in ("moment", "angle")}
    )


def slipped(run, rng):
    """One channel lacks some samples."""
    at, count = (
        int(rng.uniform(0.4, 0.6) * run.n_samples),
        int(np.ceil(0.04 * run.sample_rate / run.frequency)),
    )
    moment = np.delete(run.moment, np.arange(at, at + count))
    return replace(run, moment=moment, angle=run.angle[: moment.size])


def repeated(run, rng):
    """A buffer is written twice."""
    length = int(rng.uniform(0.03, 0.1) * run.n_samples)
    at = int(rng.uniform(0.3, 0.6) * run.n_samples)
    return replace(
        run,
        **{
            n: np.concatenate([x[: at + length], x[at : at + length], x[at + length :]])
            for n, x in (("moment", run.moment), ("angle", run.angle))
        },
    )


def high_pass(x, run, rng):
    b, a = butter(1, rng.uniform(0.4, 1.0) / (run.sample_rate / 2), "high")
    return lfilter(b, a, x)


def low_pass(x, run, rng):
    b, a = butter(1, rng.uniform(20, 40) / (run.sample_rate / 2))
    return lfilter(b, a, x)


def drifted(x, run, rng):
    return x + rng.choice([-1, 1]) * rng.uniform(0.2, 0.5) * np.std(x) * np.linspace(0, 1, x.size)


def jumped(x, run, rng):
    x[int(rng.uniform(0.4, 0.7) * x.size) :] += rng.choice([-1, 1]) * rng.uniform(0.15, 0.5) * np.std(x)
    return x


def coarse(x, run, rng):
    step = rng.uniform(0.2, 0.5) * np.std(x)
    return step * np.round(x / step)


def delayed(sign):
    def change(x, run, rng):
        return np.interp(run.time - sign * rng.uniform(1.5e-3, 3e-3), run.time, x)

    return change


def scaled(low, high):
    return lambda x, run, rng: x * rng.uniform(low, high)


def scaled_from_the_middle(x, run, rng):
    x[int(rng.uniform(0.4, 0.7) * x.size) :] *= rng.choice([0.5, 0.8, 1.25, 2.0])
    return x


def offset(x, run, rng):
    return x + rng.choice([-1, 1]) * rng.uniform(0.8, 2.0) * np.ptp(x) / 2


def hum(x, run, rng):
    w = 2 * np.pi * rng.choice([50.0, 60.0])
    return x + rng.uniform(0.05, 0.2) * np.std(x) * np.sin(w * run.time + rng.uniform(0, 6))


def noisy(x, run, rng):
    return x + rng.uniform(0.15, 0.4) * np.std(x) * rng.standard_normal(x.size)


def wrong_rate(run, rng):
    return replace(run, sample_rate=run.sample_rate * rng.choice([0.95, 0.98, 1.02, 1.05]))


def wrong_frequency(run, rng):
    return replace(run, frequency=run.frequency * rng.choice([0.985, 1.015, 0.5, 1.5]))


def dead_end(head):
    def change(run, rng):
        count = int(rng.uniform(0.15, 0.35) * run.n_samples)
        signals = {}
        for name in ("moment", "angle"):
            x = getattr(run, name).copy()
            rest = 0.002 * np.std(x) * rng.standard_normal(count)
            if head:
                x[:count] = rest
            else:
                x[-count:] = rest
            signals[name] = x
        return replace(run, **signals)

    return change


def backwards(run, rng):
    return replace(run, moment=run.moment[::-1], angle=run.angle[::-1])


def rectified(x, run, rng):
    return np.abs(x)


def own_clock(run, rng):
    """The moment is sampled by a clock that runs a little faster."""
    stretch = 1 + rng.choice([-1, 1]) * rng.uniform(0.001, 0.002)
    return replace(run, moment=np.interp(run.time * stretch, run.time, run.moment))


def swapped_channels(run, rng):
    return replace(run, moment=run.angle, angle=run.moment)


def duplicate(change):
    def put(campaign, rng):
        i, j = rng.choice(len(campaign.runs), 2, replace=False)
        one, other = campaign.runs[i], campaign.runs[j]
        moment, angle = change(one, other, rng)
        n = min(moment.size, angle.size)
        copy = replace(other, moment=moment[:n], angle=angle[:n])
        return campaign.with_runs(tuple(copy if k == j else r for k, r in enumerate(campaign.runs)))

    return put


def added_copy(campaign, rng):
    """The same run again under another name."""
    run = campaign.runs[int(rng.integers(len(campaign.runs)))]
    return campaign.with_runs((*campaign.runs, replace(run, name="again")))


def shifted_copy(campaign, rng):
    run = campaign.runs[int(rng.integers(len(campaign.runs)))]
    cut = int(rng.uniform(0.1, 0.3) * run.n_samples)
    return campaign.with_runs(
        (*campaign.runs, replace(run, name="later", moment=run.moment[cut:], angle=run.angle[cut:]))
    )


def scaled_copy(campaign, rng):
    run = campaign.runs[int(rng.integers(len(campaign.runs)))]
    factor = rng.choice([0.5, 0.8, 1.3])
    return campaign.with_runs(
        (*campaign.runs, replace(run, name="half", moment=factor * run.moment, angle=factor * run.angle))
    )


def moments_swapped(campaign, rng):
    """Two runs have each other's moment."""
    i, j = rng.choice(len(campaign.runs), 2, replace=False)
    runs = list(campaign.runs)
    n = min(runs[i].n_samples, runs[j].n_samples)
    one, other = runs[i].moment[:n], runs[j].moment[:n]
    runs[i] = replace(runs[i], moment=other, angle=runs[i].angle[:n])
    runs[j] = replace(runs[j], moment=one, angle=runs[j].angle[:n])
    return campaign.with_runs(tuple(runs))


def one_level(campaign, rng):
    level = campaign.runs[0].level
    return campaign.with_runs(tuple(r for r in campaign.runs if r.level == level))


def one_frequency(campaign, rng):
    frequency = campaign.runs[0].frequency
    return campaign.with_runs(tuple(r for r in campaign.runs if r.frequency == frequency))


def few_samples(run, rng):
    stride = int(run.sample_rate / (run.frequency * rng.uniform(10.5, 12)))
    return replace(
        run, sample_rate=run.sample_rate / stride, moment=run.moment[::stride], angle=run.angle[::stride]
    )


def two_levels(campaign, rng):
    """The first half of one run, the second of another one of the same frequency and another level."""
    runs = list(campaign.runs)
    i = int(rng.integers(len(runs)))
    kin = [r for r in runs if r.frequency == runs[i].frequency and r is not runs[i]]
    other = kin[int(rng.integers(len(kin)))]
    per = runs[i].sample_rate / runs[i].frequency
    at = int(round(round(0.5 * runs[i].n_samples / per) * per))
    parts = {
        n: np.concatenate([getattr(runs[i], n)[:at], getattr(other, n)[at:]]) for n in ("moment", "angle")
    }
    runs[i] = replace(runs[i], **parts)
    return campaign.with_runs(tuple(runs))


HELD = ("dropouts", "frozen_segment", "spikes")
GAIN = ("gain_differs",)
FAULTS = {
    "moment_clipped": Fault(of("moment")(clipped(0.85, 0.85)), ("saturation",)),
    "moment_clipped_all_runs": Fault(of("moment")(clipped(0.8, 0.9)), ("saturation",), "all"),
    "moment_clipped_top": Fault(of("moment")(clipped(0.8, 2)), ("saturation",)),
    "moment_clipped_bottom": Fault(of("moment")(clipped(2, 0.8)), ("saturation",)),
    "angle_clipped": Fault(of("angle")(clipped(0.9, 0.9)), ("saturation",)),
    "angle_clipped_top": Fault(of("angle")(clipped(0.85, 2)), ("saturation",)),
    "moment_spike": Fault(of("moment")(spikes(1, 100)), ("spikes",)),
    "moment_spikes": Fault(of("moment")(spikes(25, 6)), ("spikes",)),
    "angle_spike": Fault(of("angle")(spikes(1, 50)), ("spikes",)),
    "angle_spikes": Fault(of("angle")(spikes(25, 3)), ("spikes",)),
    "moment_zeros": Fault(of("moment")(dropouts(15, 12, True)), HELD),
    "angle_zeros": Fault(of("angle")(dropouts(15, 12, True)), HELD),
    "moment_held": Fault(of("moment")(dropouts(15, 20, False)), HELD),
    "angle_held": Fault(of("angle")(dropouts(15, 20, False)), HELD),
    "moment_frozen_segment": Fault(of("moment")(frozen(0.08)), HELD),
    "angle_frozen_segment": Fault(of("angle")(frozen(0.08)), HELD),
    "moment_dead": Fault(of("moment")(dead), ("frozen_channel",)),
    "angle_dead": Fault(of("angle")(dead), ("frozen_channel",)),
    "lost_samples": Fault(lost, ("lost_samples",)),
    "channel_slip": Fault(slipped, ("channel_slip", "lost_samples")),
    "repeated_block": Fault(repeated, ("repeated_block",)),
    "moment_ac_coupled": Fault(of("moment")(high_pass), ("ac_coupling",), "all"),
    "angle_ac_coupled": Fault(of("angle")(high_pass), ("ac_coupling",), "all"),
    "moment_low_passed": Fault(of("moment")(low_pass), ("low_pass", "channel_delay"), "all"),
    "angle_low_passed": Fault(of("angle")(low_pass), ("low_pass", "channel_delay"), "all"),
    "moment_drift": Fault(of("moment")(drifted), ("drift",)),
    "angle_drift": Fault(of("angle")(drifted), ("drift",)),
    "moment_zero_jumps": Fault(of("moment")(jumped), ("zero_jumps",)),
    "angle_zero_jumps": Fault(of("angle")(jumped), ("zero_jumps",)),
    "moment_coarse": Fault(of("moment")(coarse), ("coarse_quantisation",)),
    "angle_coarse": Fault(of("angle")(coarse), ("coarse_quantisation",)),
    "moment_late": Fault(of("moment")(delayed(1)), ("channel_delay", "low_pass"), "all"),
    "moment_early": Fault(of("moment")(delayed(-1)), ("channel_delay", "low_pass"), "all"),
    "one_run_late": Fault(of("moment")(delayed(3)), ("channel_delay", "run_differs", "gives_off_energy")),
    "moment_reversed": Fault(of("moment")(scaled(-1, -1)), ("reversed_sign",), "all"),
    "one_run_reversed": Fault(of("angle")(scaled(-1, -1)), ("reversed_sign",)),
    "sign_flips": Fault(of("moment")(lambda x, r, g: x * np.where(r.time < 0.55 * r.duration, 1, -1)), ("sign_flips",)),
    "gain_thousand": Fault(of("moment")(scaled(1000, 1000)), GAIN),
    "gain_milli_angle": Fault(of("angle")(scaled(1e-3, 1e-3)), GAIN),
    "gain_two": Fault(of("moment")(scaled(2, 2)), GAIN),
    "gain_ten_percent": Fault(of("moment")(scaled(1.1, 1.15)), GAIN),
    "angle_gain_ten_percent": Fault(of("angle")(scaled(1.12, 1.18)), GAIN),
    "gain_changes": Fault(of("moment")(scaled_from_the_middle), ("gain_changes",)),
    "level_changes": Fault(two_levels, ("level_changes",), "campaign"),
    "angle_offset": Fault(of("angle")(offset), ("angle_offset",), "all"),
    "one_run_offset": Fault(of("angle")(offset), ("angle_offset",)),
    "mains_in_moment": Fault(of("moment")(hum), ("mains_hum",), "all"),
    "mains_in_angle": Fault(of("angle")(hum), ("mains_hum",), "all"),
    "noisy_moment": Fault(of("moment")(noisy), ("excess_noise",)),
    "noisy_angle": Fault(of("angle")(noisy), ("excess_noise",)),
    "wrong_rate": Fault(wrong_rate, ("wrong_frequency",)),
    "wrong_frequency": Fault(wrong_frequency, ("wrong_frequency",)),
    "dead_tail": Fault(dead_end(False), ("dead_tail",)),
    "dead_start": Fault(dead_end(True), ("dead_start",)),
    "runs_backwards": Fault(backwards, ("gives_off_energy", "reversed_sign", "run_differs")),
    "angle_rectified": Fault(of("angle")(rectified), ("channels_disagree",)),
    "two_clocks": Fault(own_clock, ("clock_drift",)),
    "columns_swapped": Fault(swapped_channels, (*GAIN, "implausible_size", "run_differs")),
    "giga_radian": Fault(of("angle")(scaled(1e9, 1e9)), ("implausible_size",), "all"),
    "milliradian_as_radian": Fault(of("angle")(scaled(1e3, 1e3)), ("implausible_size",), "all"),
    "nanometre_angle": Fault(of("angle")(scaled(1e-9, 1e-9)), ("implausible_size",), "all"),
    "duplicate_run": Fault(added_copy, ("duplicate_run",), "campaign"),
    "shifted_copy": Fault(shifted_copy, ("duplicate_run",), "campaign"),
    "scaled_copy": Fault(scaled_copy, ("scaled_copy",), "campaign"),
    "duplicate_moment": Fault(duplicate(lambda a, b, g: (a.moment, b.angle)), ("duplicate_channel",), "campaign"),
    "moments_swapped": Fault(
        moments_swapped, ("channels_disagree", "run_differs", *GAIN, "gives_off_energy", "reversed_sign"), "campaign"
    ),
    "one_level": Fault(one_level, ("coverage",), "campaign", ("note",)),
    "one_frequency": Fault(one_frequency, ("coverage",), "campaign", ("note",)),
    "few_samples": Fault(few_samples, ("few_samples_per_period",), "all", ("note",)),
}  # fmt: skip


def findings_of(campaign):
    """Return what the check of a campaign finds."""
    return sindyjoint.check(campaign).soundness.findings
