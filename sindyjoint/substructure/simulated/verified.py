"""Models in the joints of a structure, against what its sensors measured in runs.

Each run is driven by the force (or base acceleration) that was measured. A run that repeats is simulated as the steady
motion, by harmonic balance with exact sticking, whose highest harmonics are too rough to be compared: they are left out
of both. One that does not is simulated from standstill, by steps of time, and compared in the band of the recovery.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from sindyjoint.equation.model import JointModel
from sindyjoint.equation.model_parts import has_seen, range_warnings
from sindyjoint.errors import InputError
from sindyjoint.limits import SUBSTRUCTURE
from sindyjoint.mechanics.rig_test import UNITS, RigRun, RigTest
from sindyjoint.mechanics.structure import Structure
from sindyjoint.mechanics.virtual_rig import OVERSAMPLING
from sindyjoint.numeric import Array, rms
from sindyjoint.response.oscillations import compare_oscillations, oscillation
from sindyjoint.response.run import attempted
from sindyjoint.response.verification import (
    Band,
    RunVerification,
    Settings,
    Verification,
    band_of,
    judged,
    seen_words,
)
from sindyjoint.response.verify_rig import place_by_kind
from sindyjoint.states import signals_hash
from sindyjoint.substructure.recovery import Recovery, declared_noise, recover
from sindyjoint.substructure.simulated import SteadyRun, series
from sindyjoint.substructure.simulated.segments import SegmentedRun
from sindyjoint.substructure.spectra import channel_spectra


@dataclass(frozen=True, eq=False)
class Motion:
    """What a run shows: of each sensor its signal, and of each joint its angle and rate, shape (·, samples)."""

    shown: Array
    angle: Array
    rate: Array


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """A run of a structure, as it is compared.

    Parameters
    ----------
    run : RigRun
    repeats : bool
    signals : ndarray, shape (sensors, samples)
        What is compared of the sensors, without their mean, which accelerometers do not see.
    noise : ndarray, shape (sensors,)
        RMS of what does not repeat; of a run that does not of what was declared or measured.
    highest : float
        Up to which frequency it is compared, Hz.
    simulate : callable
        Returns what the run shows of a structure whose joints have their laws; raises SimulationError.
    """

    run: RigRun
    repeats: bool
    signals: Array
    noise: Array
    highest: float
    simulate: Callable[[Structure], Motion]

    @property
    def time(self) -> Array:
        """s, shape (samples,)."""
        return np.arange(self.signals.shape[1]) / self.run.sample_rate


def _steady_run(test: RigTest, recovery: Recovery) -> MeasuredRun:
    """Return a run that repeats, by its harmonics."""
    run, spectra, steady = recovery.run, recovery.spectra, SteadyRun.of(test, recovery)
    count, shown = steady.measured.shape[1], run.responses[:, spectra.first :]
    time = np.arange(shown.shape[1]) / run.sample_rate
    above = spectra.amplitudes[1:].copy()
    above[:, :count] = 0.0
    left = shown - series(above, steady.omega, time)
    signals = left - left.mean(axis=1, keepdims=True)
    unexplained = signals - series(spectra.amplitudes[1:, :count], steady.omega, time)

    def simulate(structure: Structure) -> Motion:
        answer = steady.answer(steady.balance(structure, [hinge.law for hinge in structure.hinges]))
        angles = steady.angles(answer)[:, 1:]
        rates = 1j * steady.omega * np.arange(1, angles.shape[1] + 1) * angles
        return Motion(*(series(each, steady.omega, time) for each in (answer.shown, angles, rates)))

    noise = np.array([rms(row) for row in unexplained])
    return MeasuredRun(run, True, signals, noise, count * spectra.frequency, simulate)


def _recorded_run(test: RigTest, recovery: Recovery) -> MeasuredRun:
    """Return a run that does not repeat, within the band of the recovery and without its mean."""
    run, segments = recovery.run, SegmentedRun.of(test, recovery)

    def in_band(shown: Array) -> Array:
        parts = scipy.fft.dct(shown, norm="ortho", axis=1)
        parts[:, 0] = 0.0
        parts[:, int(2 * SUBSTRUCTURE.band * shown.shape[1]) :] = 0.0
        return np.asarray(scipy.fft.idct(parts, norm="ortho", axis=1))

    def simulate(structure: Structure) -> Motion:
        reduced = segments.reduced(structure, [hinge.law for hinge in structure.hinges])
        shown, q, v = segments.from_standstill(reduced)
        inside = slice(structure.n_joints), slice(None, OVERSAMPLING * run.drive.size, OVERSAMPLING)
        return Motion(in_band(shown), q.T[inside], v.T[inside])

    noise = np.sqrt(recovery.spectra.variance[1:, 0] * (run.drive.size - 1) / 2)
    return MeasuredRun(
        run, False, in_band(run.responses), noise, SUBSTRUCTURE.band * run.sample_rate, simulate
    )


def verify_runs(
    models: Sequence[JointModel], test: RigTest, settings: Settings, say: Callable[[str], None]
) -> Verification:
    """Compare the runs marked ``use = "validate"``, or all where none is, with a simulation of the structure.

    Parameters
    ----------
    models : sequence of JointModel
        For the joints of their kinds; see :func:`~sindyjoint.response.verify_rig.place_by_kind`.
    test : RigTest
    settings : Settings
    say : callable

    Returns
    -------
    Verification
        One entry for each run and sensor.

    Raises
    ------
    InputError
        For models that cannot stand for the joints, and runs that cannot be used.
    """
    structure, standing = place_by_kind(test, models)
    if not models:
        raise InputError("no model was given")
    kept = [run for run in test.runs if run.use == "validate"]
    seen = {run.name: _has_seen(models, run) for run in test.runs}
    driven = [run for run in test.runs if run.use != "update"]
    chosen = kept or [run for run in driven if seen[run.name] is False] or driven
    warnings = ["the response is simulated (a virtual test of the rig), not measured"] * test.simulated
    warnings += seen_words({run.name: seen[run.name] for run in chosen})
    draws = [place_by_kind(test, drawn)[0] for drawn in zip(*map(settings.drawn, models), strict=True)]
    entries: list[RunVerification] = []
    beyond: list[str] = []
    for number, run in enumerate(chosen, 1):
        say(f"simulating runs: {number} of {len(chosen)}")
        # A model is in its steady motion, whatever still vibrates freely in a run that should repeat.
        steady = None if run.frequency is None else channel_spectra(run, declared_noise(test))
        recovery = recover(test, run, steady)
        measured = (_steady_run if recovery.spectra.repeats else _recorded_run)(test, recovery)
        # A record begins at rest where its first samples are less than this share of the RMS of their sensors. In the
        # midst of a motion they are as large as that; a blow may begin with the first sample.
        begins = rms(run.responses[:, 0] / run.responses.std(axis=1)) < 0.5
        if not (measured.repeats or begins):
            warnings.append(
                f"{run.name}: simulated from standstill, and it does not begin there: begin the record before the drive"
            )
        whole = run.responses[:, run.drive.size - measured.time.size :].std(axis=1)
        share = np.sqrt(np.clip(1 - (measured.signals.std(axis=1) / whole) ** 2, 0, None))
        if measured.repeats and share.max() > SUBSTRUCTURE.large_part:
            worst = test.sensors[int(np.argmax(share))].name
            warnings.append(
                f"{run.name}: compared up to {measured.highest:.3g} Hz; {100 * share.max():.0f} % of the signal "
                f"of sensor {worst!r} lies above"
            )
        motion, failure = attempted(measured.simulate, structure)
        moved = zip(structure.hinges, standing, motion.angle, motion.rate, strict=True) if motion else ()
        exceeded = [
            line
            for hinge, model, angle, rate in moved
            if model is not None
            for line in range_warnings(model.fitted, test.motion, angle, rate, f"{run.name}, {hinge.name}")
        ]
        warnings += exceeded
        beyond += [run.name] * bool(exceeded)
        bands = [attempted(measured.simulate, other)[0] for other in draws if motion is not None]
        entries += (replace(e, seen=seen[run.name]) for e in _entries(test, measured, motion, bands, failure))
    result = judged(models[0], "rig", test.name, settings.tolerance, entries, warnings)
    return replace(result, beside=tuple(models[1:]), beyond_range=tuple(beyond))


def _has_seen(models: Sequence[JointModel], run: RigRun) -> bool | None:
    """Return whether a fit of any model has used a run; None where that is not known of one of them."""
    known = {has_seen(model.fitted, signals_hash(run.sample_rate, [run.signals])) for model in models}
    return True if True in known else None if None in known else False


def _entries(
    test: RigTest, measured: MeasuredRun, motion: Motion | None, drawn: Sequence[Motion | None], failure: str
) -> Iterator[RunVerification]:
    run = measured.run
    for place, (sensor, signal) in enumerate(zip(test.sensors, measured.signals, strict=True)):
        simulated = None if motion is None else motion.shown[place]
        band: Band | None = band_of([None if one is None else one.shown[place] for one in drawn])
        # An acceleration has turning points at every corner; a steady motion has one amplitude and one period.
        cycles = sensor.quantity == "displacement" and not measured.repeats
        oscillations = (
            oscillation(signal, run.sample_rate) if cycles else None,
            oscillation(simulated, run.sample_rate) if cycles and simulated is not None else None,
        )
        gap = compare_oscillations(*oscillations)
        error, scale = None if simulated is None else rms(simulated - signal), rms(signal)
        yield RunVerification(
            name=f"{run.name}, {sensor.name}", channel=sensor.quantity,
            drive="steady" if measured.repeats else "standstill", time=measured.time, measured=signal,
            simulated=simulated, band=band, response_nrmse=None if error is None else error / scale,
            moment_nrmse=None, noise_floor=float(measured.noise[place]) / scale,
            amplitude_rms_error=None if gap is None else gap.amplitude_rms_error,
            mean_period_difference=None if gap is None else gap.mean_period_difference,
            oscillations=oscillations, energy=None, failure=failure, scale=scale, rmse=error,
            rmse_unit=UNITS[sensor.quantity].replace("**", "^"),
        )  # fmt: skip
