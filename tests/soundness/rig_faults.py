"""Faults that the channels of a structure can show, put into sound virtual tests: the referee of the check of a rig.

Nothing of the check itself is used. Each fault has the ids by which it counts as found.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, lfilter

IN_DATA = ("stops", "biases")


@dataclass(frozen=True)
class RigFault:
    """How a fault is put in: ``change(test, run, channel, generator)`` returns a test; of a run, or of all (None)."""

    change: Callable
    ids: tuple
    every_run: bool = False
    channel: str = "sensor"  # or "drive", or "any" where none is at fault
    anywhere: bool = False  # of two runs or channels either may be named


def inject(kind, test, seed):
    """Return a test with a fault, the name of the run that has it (None: all), and the channel (0: the drive)."""
    fault, generator = RIG_FAULTS[kind], np.random.default_rng((53, seed, *kind.encode()))
    run = None if fault.every_run else int(generator.integers(len(test.runs)))
    channel = 0 if fault.channel == "drive" else 1 + int(generator.integers(len(test.sensors)))
    return fault.change(test, run, channel, generator), None if run is None else test.runs[run].name, channel


def found(kind, test, findings, run, channel, severities=IN_DATA):
    """Return whether a fault is among the findings, under its name, with its run and its channel."""
    fault = RIG_FAULTS[kind]
    name = "drive" if channel == 0 else test.sensors[channel - 1].name
    return any(
        f.id in fault.ids
        and f.severity in severities
        and (fault.anywhere or f.run in (run, None))
        and (fault.channel == "any" or f.channel == name or f.id == "swapped_channels")
        for f in findings
    )


def changed(test, run, change):
    """Return a test with the signals, shape (channels, n), of a run, or of all, changed."""
    runs = list(test.runs)
    for index in range(len(runs)) if run is None else [run]:
        signals = change(runs[index].signals.copy(), runs[index])
        runs[index] = replace(runs[index], drive=signals[0], responses=signals[1:])
    return replace(test, runs=tuple(runs))


def of_channel(change):
    """Turn a change of one signal into a fault; it is drawn once for all runs."""

    def put(test, run, channel, generator):
        state = generator.bit_generator.state

        def both(signals, recorded):
            generator.bit_generator.state = state
            signals[channel] = change(signals[channel], recorded, generator)
            return signals

        return changed(test, run, both)

    return put


def of_all(change):
    """Turn a change of all signals into a fault."""

    def put(test, run, channel, generator):
        return changed(test, run, lambda signals, recorded: change(signals, recorded, channel, generator))

    return put


def clipped(x, run, rng):
    middle, half = 0.5 * (x.max() + x.min()), 0.5 * np.ptp(x)
    return np.clip(x, middle - 0.8 * half, middle + 0.8 * half)


def spikes(x, run, rng):
    at = rng.choice(x.size - 20, 8, replace=False) + 10
    size = 3.0 * np.abs(x).max()
    x[at] += size * rng.choice([-1, 1], 8) * rng.uniform(0.7, 1.3, 8)
    return x


def dropouts(x, run, rng):
    for at in rng.integers(50, x.size - 100, 6):
        x[at : at + 12] = 0.0
    return x


def frozen(x, run, rng):
    at, length = int(rng.uniform(0.3, 0.6) * x.size), int(0.05 * x.size)
    x[at : at + length] = x[at]
    return x


def only_noise(x, run, rng):
    of_run = np.random.default_rng(
        np.frombuffer(x[:4].tobytes(), dtype=np.uint32)
    )  # no two runs have one noise
    return 0.02 * np.std(x) * of_run.normal(size=x.size)


def coarse(x, run, rng):
    step = rng.uniform(0.3, 0.8) * np.std(x)
    return step * np.round(x / step)


def gain_step(x, run, rng):
    at = int(rng.uniform(0.4, 0.6) * x.size)
    x[at:] *= rng.uniform(1.2, 1.6)
    return x


def sign_step(x, run, rng):
    x[int(rng.uniform(0.4, 0.6) * x.size) :] *= -1
    return x


def gain(x, run, rng):
    return x * float(np.exp(rng.choice([-1, 1]) * rng.uniform(0.05, 0.25)))


def unit(x, run, rng):
    return x * float(rng.choice([9.80665, 1 / 9.80665, 1000.0, 0.001]))


def pound(x, run, rng):
    return x / 4.44822


def delayed(x, run, rng):
    """Later by 1 to 5 ms, between samples; the ends of the record are repeated."""
    time = np.arange(x.size) / run.sample_rate
    return np.interp(time - rng.uniform(1e-3, 5e-3), time, x)


def low_pass(x, run, rng):
    b, a = butter(1, rng.uniform(20, 40) / (run.sample_rate / 2))
    return lfilter(b, a, x)


def lost(signals, run, channel, rng):
    at, count = (
        int(rng.uniform(0.4, 0.6) * run.drive.size),
        int(rng.uniform(0.01, 0.03) * run.sample_rate) + 6,
    )
    return np.delete(signals, np.arange(at, at + count), axis=1)


def slipped(signals, run, channel, rng):
    at, count = int(rng.uniform(0.4, 0.6) * run.drive.size), int(0.02 * run.sample_rate) + 2
    one = np.delete(signals[channel], np.arange(at, at + count))
    signals = signals[:, : one.size]
    signals[channel] = one
    return signals


def repeated(signals, run, channel, rng):
    n = run.drive.size
    at, length = int(rng.uniform(0.3, 0.6) * n), int(rng.uniform(0.03, 0.1) * n)
    return np.hstack([signals[:, : at + length], signals[:, at : at + length], signals[:, at + length :]])


def level_step(signals, run, channel, rng):
    signals[:, int(rng.uniform(0.4, 0.6) * run.drive.size) :] *= rng.uniform(1.2, 1.6)
    return signals


def dead_tail(signals, run, channel, rng):
    n, noise = run.drive.size, np.std(np.diff(signals, axis=1), axis=1)[:, None]
    at = int(rng.uniform(0.6, 0.7) * n)
    signals[:, at:] = 0.01 * noise * rng.normal(size=(len(signals), n - at))
    return signals


def neighbour(signals, run, channel, rng):
    """The column of another sensor is read for this one."""
    others = [c for c in range(1, len(signals)) if c != channel]
    signals[channel] = signals[int(rng.choice(others))]
    return signals


def swapped(test, run, channel, rng):
    other = int(rng.choice([c for c in range(1, 1 + len(test.sensors)) if c != channel]))

    def exchange(signals, recorded):
        signals[[channel, other]] = signals[[other, channel]]
        return signals

    return changed(test, run, exchange)


def misplaced(test, run, channel, rng):
    """The sensor sits where another one does, by the file."""
    others = [s.point for i, s in enumerate(test.sensors, 1) if i != channel]
    sensors = list(test.sensors)
    sensors[channel - 1] = replace(sensors[channel - 1], point=str(rng.choice(others)))
    return replace(test, sensors=tuple(sensors))


def wrong_frequency(test, run, channel, rng):
    runs = list(test.runs)
    runs[run] = replace(runs[run], frequency=runs[run].frequency * rng.uniform(1.008, 1.02))
    return replace(test, runs=tuple(runs))


def copied_run(scale):
    def put(test, run, channel, rng):
        other = int(rng.choice([i for i in range(len(test.runs)) if i != run]))
        runs, kept = list(test.runs), test.runs[other]
        factor = rng.uniform(1.3, 2.0) if scale else 1.0
        runs[run] = replace(runs[run], drive=factor * kept.drive, responses=factor * kept.responses)
        return replace(test, runs=tuple(runs))

    return put


FILTERED = ("channel_delay", "gain_differs", "sensors_disagree")
NOT_ONE = ("duplicate_channel", "sensors_disagree")
RIG_FAULTS = {
    "sensor_saturated": RigFault(of_channel(clipped), ("saturation",)),
    "drive_saturated": RigFault(of_channel(clipped), ("saturation",), channel="drive"),
    "sensor_spikes": RigFault(of_channel(spikes), ("spikes",)),
    "drive_spikes": RigFault(of_channel(spikes), ("spikes",), channel="drive"),
    "sensor_dropouts": RigFault(of_channel(dropouts), ("dropouts",)),
    "sensor_frozen": RigFault(of_channel(frozen), ("frozen_segment",)),
    "sensor_constant": RigFault(of_channel(lambda x, run, rng: np.zeros(x.size)), ("frozen_channel",)),
    "drive_constant": RigFault(of_channel(lambda x, run, rng: np.zeros(x.size)), ("frozen_channel",), channel="drive"),
    "sensor_noise": RigFault(of_channel(only_noise), ("no_signal",)),
    "sensor_noise_all": RigFault(of_channel(only_noise), ("no_signal",), every_run=True),
    "drive_noise": RigFault(of_channel(only_noise), ("no_signal",), channel="drive"),
    "sensor_coarse": RigFault(of_channel(coarse), ("coarse_quantisation",)),
    "sensor_gain_step": RigFault(of_channel(gain_step), ("gain_changes",)),
    "sensor_sign_step": RigFault(of_channel(sign_step), ("sign_flips",)),
    "level_step": RigFault(of_all(level_step), ("level_changes",), channel="any"),
    "samples_lost": RigFault(of_all(lost), ("lost_samples",), channel="any"),
    "sensor_slipped": RigFault(of_all(slipped), ("channel_slip",)),
    "block_repeated": RigFault(of_all(repeated), ("repeated_block",), channel="any"),
    "tail_dead": RigFault(of_all(dead_tail), ("dead_tail",), channel="any"),
    "frequency_wrong": RigFault(wrong_frequency, ("wrong_frequency",), channel="any"),
    "run_copied": RigFault(copied_run(False), ("duplicate_run",), channel="any", anywhere=True),
    "run_scaled": RigFault(copied_run(True), ("scaled_copy",), channel="any", anywhere=True),
    "column_twice": RigFault(of_all(neighbour), NOT_ONE, every_run=True, channel="any", anywhere=True),
    "sensor_gain": RigFault(of_channel(gain), ("gain_differs",), every_run=True),
    "drive_gain": RigFault(of_channel(pound), ("gain_differs",), every_run=True, channel="drive"),
    "sensor_unit": RigFault(of_channel(unit), ("gain_differs", "no_signal"), every_run=True),
    "sensor_reversed": RigFault(of_channel(lambda x, run, rng: -x), ("reversed_sign",), every_run=True),
    "drive_reversed": RigFault(of_channel(lambda x, run, rng: -x), ("reversed_sign",), every_run=True, channel="drive"),
    "sensor_late": RigFault(of_channel(delayed), ("channel_delay",), every_run=True),
    "drive_late": RigFault(of_channel(delayed), ("channel_delay",), every_run=True, channel="drive"),
    "sensor_filtered": RigFault(of_channel(low_pass), FILTERED, every_run=True),
    "sensor_misplaced": RigFault(misplaced, ("sensors_disagree", "gain_differs"), every_run=True),
    "sensors_swapped": RigFault(swapped, ("swapped_channels",), every_run=True),
    "run_gain": RigFault(of_channel(gain), ("gain_differs",)),
    "run_reversed": RigFault(of_channel(lambda x, run, rng: -x), ("reversed_sign",)),
}  # fmt: skip
#: What only a run that repeats shows.
REPEATING = ("frequency_wrong", "level_step", "samples_lost", "sensor_slipped", "tail_dead", "sensor_gain_step",
             "sensor_sign_step")  # fmt: skip
