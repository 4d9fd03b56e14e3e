"""A pulse test as an output-error problem, and the pulse that would tell two of its effects apart.

Fits go over horizons that grow: over a long record a slightly wrong frequency is whole cycles off, and a search that
begins with all of it ends in the nearest wrong cycle.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sindyjoint.clock import Portion
from sindyjoint.diagnosis.effects.change import Change
from sindyjoint.diagnosis.effects.setup import Setup
from sindyjoint.diagnosis.policy import STRUCTURE, DiagnosisPolicy
from sindyjoint.diagnosis.problem import Say
from sindyjoint.diagnosis.result import Advice
from sindyjoint.diagnosis.structure import (
    STEP_PRIOR,
    FittedChange,
    OutputError,
    attempted,
    differences,
    parted,
)
from sindyjoint.diagnosis.structure.kinds import JointKind
from sindyjoint.mechanics.rigs import MeasuredResponse, Rig
from sindyjoint.mechanics.virtual_rig import with_laws
from sindyjoint.numeric import Array, Integers, delayed, main_frequency, noise_by_differences
from sindyjoint.response.output_error import STEP

# Pulses that are tried, as multiples of the one that was given; that one first, which costs no further test.
FORCES = (1.0, 0.3, 3.0)


@dataclass(frozen=True, eq=False)
class PulseProblem(OutputError):
    """Records of a rig, a model in its joint, and the effects named so far.

    Parameters
    ----------
    rig : Rig
    places : frozenset of str
        Joints that the model stands for.
    kind : JointKind
        Its model, and the laws of that.
    records : tuple of MeasuredResponse
    noise : tuple of RecordNoise
        Of each record.
    found : tuple of Change
    pulse_uncertainty : float
        Relative standard error of the force.
    step_error : tuple of ndarray
        What the time step does to each record, m; empty where it is not known.
    policy : DiagnosisPolicy
    """

    rig: Rig
    places: frozenset[str]
    kind: JointKind
    records: tuple[MeasuredResponse, ...]
    noise: "tuple[RecordNoise, ...]"
    found: tuple[Change, ...] = ()
    pulse_uncertainty: float = 0.0
    step_error: tuple[Array, ...] = ()
    policy: DiagnosisPolicy = STRUCTURE
    _kept: dict[object, Any] = field(default_factory=dict, repr=False)

    @property
    def duration(self) -> float:
        """Of the longest record, s."""
        return max(r.displacement.size / r.sample_rate for r in self.records)

    def rows(self, duration: float | None = None) -> float:
        """Return the effective number of samples up to a time."""
        duration = self.duration if duration is None else duration
        counts = [self.count(record, duration) for record in self.records]
        return sum(count / noise.length for count, noise in zip(counts, self.noise, strict=True))

    @property
    def groups(self) -> Integers:
        """Of each residual what is predicted together from the others: stretches of the records, and the priors."""
        parts = parted([self.count(record, self.duration) for record in self.records])
        return np.append(parts, np.full(self.priors, parts.max() + 1))

    @property
    def priors(self) -> int:
        """Numbers that have a prior: step, pulse, coefficients of the model."""
        return 2 + self.kind.size

    @property
    def free(self) -> Array:
        """How far each number with a prior may move, in its standard errors."""
        free = np.full(self.priors, 8.0)
        free[1] *= self.pulse_uncertainty > 0
        return free

    def setup(self, x: Array, extra: Change | None = None) -> Setup:
        """Return the setup of some numbers."""
        setup = Setup(
            tuple(self.rig.items), 1 / self.rig.clamp_stiffness, self.kind.setup(x[2 : self.priors]).numbers,
            pulse=1 + self.pulse_uncertainty * float(x[1]),
        )  # fmt: skip
        return self.changed(setup, x, extra)

    def simulate(self, setup: Setup, duration: float, step: float | None = None) -> tuple[Array, ...] | None:
        """Return the displacement of each record up to a time, m; None where the simulation fails."""
        motions = self._motion(setup, duration + abs(setup.delay), step)
        if motions is None:
            return None
        shown = []
        for record, motion in zip(self.records, motions, strict=True):
            count = self.count(record, duration)
            time = np.arange(motion.size) / record.sample_rate
            if setup.delay:
                motion = delayed(motion, setup.delay * record.sample_rate)
            shown.append(setup.gain * motion[:count] + setup.zero + setup.drift * time[:count])
        return tuple(shown)

    @staticmethod
    def count(record: MeasuredResponse, duration: float) -> int:
        """Return the samples of a record up to a time."""
        return min(record.displacement.size, max(int(round(duration * record.sample_rate)), 8))

    def _motion(self, setup: Setup, duration: float, step: float | None) -> tuple[Array, ...] | None:
        def simulated() -> tuple[Array, ...] | None:
            if not all(map(np.isfinite, setup.numbers.values())):
                return None  # friction that never becomes steady, for one
            law = self.kind.laws.law(setup)
            rig = with_laws(
                replace(
                    self.rig,
                    items=setup.items,
                    clamp_stiffness=np.inf if setup.compliance <= 0 else 1 / setup.compliance,
                    excitation=self.rig.excitation.scaled(setup.pulse),
                ),
                lambda hinge: law if hinge.name in self.places else hinge.law,
            )
            points = tuple(dict.fromkeys(r.point for r in self.records))
            # Modes are added to the search only as far as records can show them.
            options: dict[str, Any] = {"modes": min(rig.modes, 6), "step": rig.step if step is None else step}
            found = {
                rate: rig.respond(points=points, duration=duration, sample_rate=rate, **options).displacement
                for rate in {r.sample_rate for r in self.records}
            }
            motions = tuple(found[r.sample_rate][r.point] for r in self.records)
            return motions if all(np.all(np.isfinite(m)) for m in motions) else None

        return self._once((setup.motion_key, duration, step), lambda: attempted(simulated), 64)

    def residuals(self, x: Array, duration: float, extra: Change | None = None) -> Array | None:
        """Return simulated less measured over noise, then the prior rows."""
        shown = self.simulate(self.setup(x, extra), duration)
        if shown is None:
            return None
        parts = []
        for i, (record, noise, signal) in enumerate(zip(self.records, self.noise, shown, strict=True)):
            residual = signal - record.displacement[: signal.size]
            if self.step_error:
                residual = residual + float(x[0]) * self.step_error[i][: signal.size]
            parts.append(residual / noise.weight)
        return np.concatenate([*parts, x[: self.priors]])

    def derivatives(
        self, x: Array, residual: Array, duration: float, places: Sequence[int], extra: Change | None = None
    ) -> Array:
        """Return the columns of the Jacobian at some places, by differences, shape (rows, len(places))."""
        low, high = self.bounds(extra)
        steps = STEP * np.maximum(1.0, 0.1 * (high - low))
        steps[: self.priors] = STEP_PRIOR
        steps[high <= low] = 0.0
        return differences(lambda at: self.residuals(at, duration, extra), x, residual, places, steps, high)

    def prepared(self, x: Array) -> Self:
        """Return the problem with what the time step does to the response, by Richardson's rule for order two."""
        setup = self.setup(x)
        whole = self.simulate(setup, self.duration)
        half = self.simulate(setup, self.duration, 0.5 * self.rig.step)
        if whole is None or half is None:
            return replace(self, step_error=())
        return replace(self, step_error=tuple(4 / 3 * (b - a) for a, b in zip(whole, half, strict=True)))


def separating_pulses(
    problem: PulseProblem, members: Sequence[FittedChange], period: float, search: Portion, say: Say
) -> tuple[tuple[Advice, ...], int, int]:
    """Return the pulse and the output point that separate the two likeliest members of a class best, if any does.

    Beside it how many pulses were tried, and of how many. The problem holds everything that was named, ``members`` the
    named effect first; the level that is advised is the peak displacement at the point, m.
    """
    mine, rival = members[:2]
    base = replace(problem, found=tuple(c for c in problem.found if c is not mine.change), _kept={})
    if mine.x.size != base.base_size + mine.change.size:
        return (), 0, len(FORCES)
    found, tried = list[Advice](), 0
    for force in FORCES:
        say(f"advice: {tried} of {len(FORCES)} pulses tried")

        def promised(force: float = force) -> list[Advice]:
            return _promised(base, mine, rival, force, float(f"{1 / period:.3g}"))

        more = search.do(promised, None, "")
        if more is None:
            break
        found, tried = [*found, *more], tried + 1
    # The first of those that promise as much: that costs least.
    best = max(found, key=lambda each: round(each.expected_confidence, 3), default=None)
    enough = best is not None and best.expected_confidence >= problem.policy.least_confidence
    return (best,) if best is not None and enough else (), tried, len(FORCES)


def _promised(
    base: PulseProblem, mine: FittedChange, rival: FittedChange, force: float, frequency: float
) -> list[Advice]:
    """Return what a pulse of so many times the force is expected to show at each point."""
    points = [name for name, row in base.rig.structure().points.items() if row.any() and name != "tip"]
    points = list(dict.fromkeys([*(r.point for r in base.records), *points]))
    rate, duration = base.records[0].sample_rate, base.duration
    rig = replace(base.rig, excitation=base.rig.excitation.scaled(force))
    blank = tuple(MeasuredResponse(p, np.zeros(round(duration * rate)), rate) for p in points)
    noise = (base.noise[0],) * len(points)
    new = replace(base, rig=rig, records=blank, noise=noise, step_error=(), _kept={})
    truth = new.simulate(new.setup(mine.x, mine.change), duration)
    if truth is None:
        return []
    measured = tuple(replace(b, displacement=signal) for b, signal in zip(blank, truth, strict=True))
    new = replace(new, records=measured)
    residual = new.residuals(rival.x, duration, rival.change)
    if residual is None:
        return []
    columns = new.derivatives(rival.x, residual, duration, range(base.base_size, rival.x.size), rival.change)
    pulse = (
        "second response to the same pulse" if force == 1 else f"pulse {force:g} times as strong, measured"
    )
    found = []
    for i, point in enumerate(points):
        rows = slice(i * truth[i].size, (i + 1) * truth[i].size)
        basis, _ = np.linalg.qr(columns[rows])
        apart = residual[rows] - basis @ (basis.T @ residual[rows])
        confidence = float(1 / (1 + np.exp(-min(0.5 * float(apart @ apart), 50.0))))
        peak = float(f"{np.abs(truth[i]).max():.3g}")
        found.append(Advice((mine.name, rival.name), frequency, peak, f"{pulse} at {point!r}", confidence))
    return found


@dataclass(frozen=True)
class RecordNoise:
    """Noise of a record.

    Parameters
    ----------
    sigma : float
        RMS, m.
    length : float
        Samples that count as one: one for white noise, more where neighbours go together.
    """

    sigma: float
    length: float

    @property
    def weight(self) -> float:
        """What a residual is divided by so that its square sums to χ²."""
        return self.sigma * float(np.sqrt(self.length))


def record_noise(
    displacement: ArrayLike, sample_rate: float, policy: DiagnosisPolicy = STRUCTURE
) -> RecordNoise:
    """Return the noise of a record of free decay.

    In the late part of the record, window by window, a constant, a trend and the lines of the spectrum, with amplitudes
    that may change linearly, are taken away; the residual is noise. White noise by fourth differences is its lower
    bound. Its correlation says how many samples count as one.

    Parameters
    ----------
    displacement : array_like, shape (n,)
    sample_rate : float
        Hz.
    policy : DiagnosisPolicy

    Examples
    --------
    >>> t = np.arange(8000) / 1000
    >>> noise = np.random.default_rng(0).standard_normal(8000)
    >>> found = record_noise(np.exp(-0.1 * t) * np.sin(26 * t) + 0.01 * noise, 1000.0)
    >>> 0.0095 < found.sigma < 0.0105, found.length < 1.5
    (True, True)
    """
    values = np.asarray(displacement, dtype=np.float64)
    least = max(noise_by_differences(values, 4), 1e-9 * float(np.std(values)))
    frequency = main_frequency(values, sample_rate)
    late = values[-max(int(policy.late_share * values.size), min(values.size, 64)) :]
    # Window by window, each of three main periods, by at most five lines.
    width = int(3.0 * sample_rate / frequency)
    count = late.size // max(width, 1)
    if count < 1 or width < 24:
        return RecordNoise(least, 1.0)
    width = late.size // count
    windows = late[-count * width :].reshape(count, width)
    lines = [_refined(windows, sample_rate, [], frequency, sample_rate / values.size)]
    while True:
        residual, used = _explained(windows, sample_rate, lines)
        extra = _line(residual, sample_rate, policy) if len(lines) < 5 and used + 4 < width // 2 else None
        if extra is None or min(abs(extra - f) for f in lines) < 0.5 * sample_rate / width:
            break
        lines.append(_refined(windows, sample_rate, lines, extra, sample_rate / width))
    sigma = float(np.sqrt(np.sum(residual**2) / max(count * (width - used), 1)))
    return RecordNoise(max(sigma, least), _length(residual) if sigma > 0 else 1.0)


def _explained(windows: Array, sample_rate: float, lines: list[float]) -> tuple[Array, int]:
    """Return windows less what lines and a trend explain of them, and the numbers that took."""
    width = windows.shape[1]
    time = (np.arange(width) - (width - 1) / 2) / sample_rate
    ramp = time / time[-1]
    columns = [np.ones(width), ramp]
    for f in lines:
        phase = 2 * np.pi * f * time
        for wave in (np.cos(phase), np.sin(phase)):
            columns += [wave, ramp * wave]
    basis, _ = np.linalg.qr(np.array(columns).T)
    return windows - (windows @ basis) @ basis.T, len(columns)


def _refined(windows: Array, sample_rate: float, lines: list[float], guess: float, width: float) -> float:
    """Return the frequency within a resolution of a guess that leaves least, Hz."""

    def residual(frequency: float) -> float:
        return float(np.sum(_explained(windows, sample_rate, [*lines, frequency])[0] ** 2))

    found = scipy.optimize.minimize_scalar(
        residual, bounds=(max(guess - width, 0.1 * guess), guess + width), method="bounded"
    )
    return float(found.x) if residual(float(found.x)) < residual(guess) else guess


def _line(windows: Array, sample_rate: float, policy: DiagnosisPolicy) -> float | None:
    """Return the frequency of a line that stands out of the windows' mean spectrum, Hz."""
    power = np.mean(np.abs(np.fft.rfft(windows * np.hanning(windows.shape[1]), axis=1)) ** 2, axis=0)[1:]
    ground = scipy.ndimage.median_filter(power, size=min(31, power.size | 1), mode="nearest")
    place = int(np.argmax(power / np.maximum(ground, 1e-300)))
    if power[place] < policy.line_ratio * ground[place] or power[place] <= 1e-20 * power.max():
        return None
    return float((place + 1) * sample_rate / windows.shape[1])


def _length(windows: Array) -> float:
    """Return 1 + 2·Σρ over the lags before the correlation first vanishes."""
    width = windows.shape[1]
    spectrum = np.mean(np.abs(np.fft.rfft(windows, 2 * width, axis=1)) ** 2, axis=0)
    lags = min(width, 200)
    correlation = np.fft.irfft(spectrum)[:lags] / (width - np.arange(lags))
    rho = correlation / correlation[0]
    end = np.flatnonzero(rho < 2 / np.sqrt(windows.size))
    return float(max(1.0, 1 + 2 * rho[1 : end[0] if end.size else rho.size].sum()))
