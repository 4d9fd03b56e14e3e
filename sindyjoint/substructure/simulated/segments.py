"""A run of a structure that does not repeat, simulated in segments: multiple shooting.

Over a long record a slightly wrong frequency ends whole cycles off, which hides the minimum; over a segment of a few
periods it does not. Each begins at a state of its own (Bock, in: Modelling of Chemical Reaction Systems, 1981), which
is no number of the fit: what its error does to the residual of the segment is projected out, to first order, under a
prior as wide as the motion is large, and before each fit it is moved to where it fits best.

So is, once the states are near, what slow errors of the drive do, under its noise as prior (errors in variables:
Fuller, Measurement Error Models, 1987, section 3.2): the structure amplifies that noise near its resonance.

Residuals are compared in the band of the recovery: the cosine transform of a segment leaves white noise white.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
import scipy

from sindyjoint.limits import SUBSTRUCTURE
from sindyjoint.mechanics import Law
from sindyjoint.mechanics.excitation import sampled
from sindyjoint.mechanics.rig_test import RigTest, with_drive
from sindyjoint.mechanics.structure import Structure, craig_bampton, projected
from sindyjoint.mechanics.transient import State, trajectory
from sindyjoint.mechanics.virtual_rig import OVERSAMPLING, REACH, between_samples, recorded
from sindyjoint.numeric import (
    COARSE_DIFFERENCE,
    MEDIAN_SQUARE,
    Array,
    Booleans,
    delayed,
    noise_by_differences,
    rms,
)
from sindyjoint.response.output_error import DRAWS
from sindyjoint.substructure.recovery import Recovery
from sindyjoint.substructure.simulated.segment_parts import (
    RECORDED,
    Channels,
    carried,
    kept,
    moved,
    moves_of,
    pace_of,
    slow_lines,
)

# Periods of the first frequency with joints that stick in a segment.
PERIODS = 10
# Fixed-interface modes of the structure that is simulated.
MODES = 12
# Times as many steps, with which what those leave out is found.
FINER = 4
# Errors of the drive move joints up to so many times the first frequency with joints that stick.
DRIVEN = 2.0
# Steps of a state towards where it fits best.
ROUNDS = 2
# Neighbouring lines whose residuals count as one: what a law lacks is alike in so many, and hundreds of groups remain.
LINES = 10


@dataclass(frozen=True, eq=False)
class SegmentedRun:
    """A run that does not repeat; what simulates it raises `SimulationError` where a law has no motion.

    Parameters
    ----------
    test : RigTest
        Its sensors.
    name : str
    rate : float
        Hz.
    drive : ndarray, shape (n,)
    measured : ndarray, shape (sensors, n)
    drive_sigma : float
    sigma : ndarray, shape (sensors,)
        Noise of a sample.
    basis : ndarray, shape (coordinates, r)
        Of the structure that is simulated.
    spans : tuple of (int, int)
        First sample of each segment and that after its last; it is simulated from `REACH` samples before the one to as
        many after the other, which the recorder's filter needs.
    finer : int
        Samples of the drive that is simulated, for one of the record.
    steps : int
        Of the simulation, for one of these.
    driven : float
        Up to which errors of the drive are projected out as those of a state are, Hz; zero for none.
    directions : tuple of State
        Moves of a state: of the size of the motion, mode by mode.
    states : tuple of State
        With which each segment begins; empty before they are known.
    spread : tuple of ndarray, shape (rows, m)
        Of each segment: W of r − W·Wᵀ·r, the residual without what errors of its state explain.
    pulls : tuple of ndarray, shape (len(directions), rows)
        Of each segment: by what its state is to move for a residual, to first order.
    of_drive : tuple of ndarray, shape (rows, lines)
        Of each segment: what errors of the drive do to it; empty before they are looked for.
    missing : tuple of ndarray, shape (rows,)
        Of each segment: what the steps of the simulation leave out of its residual.
    shares : tuple of float
        Of each segment: noise of the sensors in that of sensors and drive together; empty for ones.
    """

    test: RigTest
    name: str
    rate: float
    drive: Array
    measured: Array
    drive_sigma: float
    sigma: Array
    basis: Array
    spans: tuple[tuple[int, int], ...]
    finer: int
    steps: int
    driven: float = 0.0
    directions: tuple[State, ...] = ()
    states: tuple[State, ...] = ()
    spread: tuple[Array, ...] = ()
    pulls: tuple[Array, ...] = ()
    of_drive: tuple[Array, ...] = ()
    missing: tuple[Array, ...] = ()
    shares: tuple[float, ...] = ()

    @classmethod
    def of(cls, test: RigTest, recovery: Recovery) -> Self:
        """Return a run as it was recorded, its noise as it was found.

        Raises
        ------
        InputError
            For sensors on a shaken base that show no acceleration.
        """
        run, n = recovery.run, recovery.run.drive.size
        periods = (n - 2 * REACH) / run.sample_rate * float(test.structure.frequencies(1, locked=True)[0])
        ends = np.linspace(REACH, n - REACH, max(1, int(periods / PERIODS)) + 1).round().astype(int).tolist()
        noise = np.sqrt(recovery.spectra.variance[:, 0] * (n - 1) / 2)
        if not test.drive_noise:
            noise[0] *= np.clip(
                noise_by_differences(run.drive, 6) / noise[0], 1 / SUBSTRUCTURE.clearly, SUBSTRUCTURE.clearly
            )
        own = carried(test)
        basis = craig_bampton(
            with_drive(test.structure, test.at), [test.at, *(sensor.point for sensor in test.sensors)], MODES
        ).basis
        assert basis is not None
        return cls(
            test, run.name, run.sample_rate, run.drive,
            run.responses - np.outer(own, run.drive), float(noise[0]),
            np.hypot(noise[1:], own * noise[0]), basis,
            tuple(zip(ends[:-1], ends[1:], strict=True)), *pace_of(test.structure, run.sample_rate)
        )  # fmt: skip

    @property
    def rows(self) -> int:
        """Number of its residuals."""
        return sum(self.segment_rows(a, b) for a, b in self.spans)

    @property
    def weights(self) -> tuple[float, ...]:
        """Of each segment: its share, or one."""
        return self.shares or (1.0,) * len(self.spans)

    @property
    def power(self) -> float:
        """Sum of squares of what the sensors show of all segments, in their noise and that of the drive."""
        parts = (
            share * self.measured[:, a:b] for (a, b), share in zip(self.spans, self.weights, strict=True)
        )
        return sum(float(np.sum((part / self.sigma[:, None]) ** 2)) for part in parts)

    def segment_rows(self, first: int, stop: int) -> int:
        """Return the number of residuals of a segment."""
        return kept(stop - first) * len(self.sigma)

    def reduced(self, structure: Structure, laws: Sequence[Law]) -> Structure:
        """Return the structure that is simulated, with laws in its joints."""
        hinges = tuple(replace(h, law=law) for h, law in zip(structure.hinges, laws, strict=True))
        return projected(with_drive(replace(structure, hinges=hinges), self.test.at), self.basis)

    def with_drive_noise(self, generator: np.random.Generator) -> Self:
        """Return the run with noise on the drive as much as there is, besides what is projected out."""
        noise = np.asarray(self.drive_sigma * generator.normal(size=self.drive.size))
        parts = scipy.fft.dct(noise, norm="ortho")
        parts[: int(2 * self.driven / self.rate * noise.size)] = 0.0
        return replace(self, drive=self.drive + scipy.fft.idct(parts, norm="ortho"))

    def liveliest(self, motion: Array, count: int) -> Self:
        """Return the run with the segments, at most so many, in which a signal of as many samples is largest."""
        sizes = [-rms(motion[a:b]) for a, b in self.spans]
        return replace(self, spans=tuple(self.spans[i] for i in sorted(np.argsort(sizes)[:count])))

    def where(self, moving: Booleans) -> Self:
        """Return the run with the segments in which joints move, of as many samples."""
        return replace(self, spans=tuple((a, b) for a, b in self.spans if moving[a:b].any()))

    def residual(self, reduced: Structure, channels: Channels = RECORDED) -> list[Array]:
        """Return simulated less measured of each segment, without what its state explains."""
        shown = (shown for shown, _ in self.motions(reduced, channels))
        parts = (
            share * (self._compared(span, each) + missing)
            for span, each, missing, share in zip(self.spans, shown, self.missing, self.weights, strict=True)
        )
        return [part - w @ (w.T @ part) for part, w in zip(parts, self.spread, strict=True)]

    def scatter(self, jacobian: Array, residual: Array) -> Array:
        """Return the scatter Σ s·sᵀ of scores of a fit's numbers, shape (k, k), of the rows of all segments.

        A score is the sum of Jᵀr over all sensors and `LINES` neighbouring lines of a segment: what noise of the drive
        does through the structure, and what the law lacks, is alike in these and no white noise of the sensors (Liang
        and Zeger, Biometrika 73(1), 1986).
        """
        ends = np.cumsum([self.segment_rows(*span) for span in self.spans])[:-1]
        parts = np.split(jacobian * residual[:, None], ends)
        by_line = [part.reshape(len(self.sigma), -1, part.shape[1]).sum(axis=0) for part in parts]
        scores = np.vstack([np.add.reduceat(part, np.arange(0, len(part), LINES)) for part in by_line])
        return np.asarray(scores.T @ scores)

    def motions(
        self, reduced: Structure, channels: Channels = RECORDED
    ) -> Iterator[tuple[Array, tuple[Array, Array]]]:
        """Yield what the sensors show of each segment, shape (sensors, n), and angle and rate of joints, (n, joints).

        Internal states that the law did not have when the states were found go on from one segment to the next.
        """
        internal = np.zeros((reduced.n_joints, max(1, *(hinge.law.n_states for hinge in reduced.hinges))))
        for span, (q, v, z) in zip(self.spans, self.states, strict=True):
            begin = (q, v, z if z.any() else internal)
            shown, motion = self._simulated(reduced, span, begin, channels)
            internal = motion[2][-2 * REACH * self.finer - 1]
            inside = slice(REACH * self.finer, (REACH + span[1] - span[0]) * self.finer, self.finer)
            angle, rate = (part[inside, : reduced.n_joints] for part in motion[:2])
            yield shown, (angle, rate)

    def with_measured_noise(self, reduced: Structure) -> Self:
        """Return the run with noise of sensors for which none was declared as the upper half of the band shows it.

        A record that does not repeat shows its noise badly, and what a model lacks lies below: the median of the
        squares there is that of white noise, 0.4549 of its variance.
        """
        count = len(self.sigma)
        lines = [part.reshape(count, -1) for part in replace(self, shares=()).residual(reduced)]
        upper = np.hstack([part[:, part.shape[1] // 2 :] for part in lines])
        ratio = np.sqrt(np.median(upper**2, axis=1) / MEDIAN_SQUARE)
        declared = [bool(sensor.noise) for sensor in self.test.sensors]
        ratio = np.where(declared, 1.0, np.clip(ratio, 1 / SUBSTRUCTURE.clearly, SUBSTRUCTURE.clearly))
        weights = [1 / np.repeat(ratio, part.size // count) for part in self.missing]
        missing = tuple(part * w for part, w in zip(self.missing, weights, strict=True))
        of_drive = tuple(part * w[:, None] for part, w in zip(self.of_drive, weights, strict=False))
        return replace(self, sigma=self.sigma * ratio, missing=missing, of_drive=of_drive)

    def with_noise_of_drive(self, reduced: Structure) -> Self:
        """Return the run with residuals in the noise of sensors and drive together, segment by segment."""
        bare = replace(self, shares=())
        clear, power = bare.residual(reduced), np.zeros(len(self.spans))
        for draw in range(DRAWS):
            noisy = bare.with_drive_noise(np.random.default_rng(draw)).residual(reduced)
            power += [np.mean((a - b) ** 2) / DRAWS for a, b in zip(noisy, clear, strict=True)]
        return replace(self, shares=tuple((1 / np.sqrt(1 + power)).tolist()))

    def settled(self, reduced: Structure, driven: bool = False) -> Self:
        """Return the run with the states where they fit best, and with what their errors explain there.

        ``driven``: errors of the drive are projected out, too, up to `DRIVEN` times the first frequency.
        """
        first = float(self.test.structure.frequencies(1, locked=True)[0])
        begun = replace(self.begun(reduced), driven=DRIVEN * first if driven else 0.0)
        missing = self.missing or begun._missing(reduced)
        # What the drive's errors do takes most of the time: it is kept once it was found near the end of a fit.
        of_drive = self.of_drive or (None,) * len(begun.spans)
        parts = zip(begun.spans, begun.states, missing, of_drive, strict=True)
        states, spread, pulls, effects = zip(*(begun._settle(reduced, *each) for each in parts), strict=True)
        again = driven and self.driven > 0
        settled = replace(begun, states=states, spread=spread, pulls=pulls, of_drive=effects if again else ())
        return replace(settled, missing=settled._missing(reduced))

    def followed(self, reduced: Structure, channels: Channels = RECORDED) -> Self:
        """Return the run with its states moved to where they fit other numbers, by the known effects of their errors.

        What a number changes is projected out to first order only as far as a state explains it: a state that stays
        where it was holds the numbers near those that it was found with.
        """
        shown = (shown for shown, _ in self.motions(reduced, channels))
        parts = zip(self.spans, self.states, self.missing, self.pulls, shown, strict=True)
        states = tuple(
            moved(state, pull @ (self._compared(span, each) + missing), self.directions)
            for span, state, missing, pull, each in parts
        )
        return replace(self, states=states)

    def from_standstill(self, reduced: Structure) -> tuple[Array, Array, Array]:
        """Return what the sensors show of the whole record, simulated from standstill, and the motion behind it.

        Returns
        -------
        shown : ndarray, shape (sensors, n)
        q, v : ndarray, shape (OVERSAMPLING·n, r)
            Coordinates of the reduced structure and their rates; the joints come first.
        """
        fine = replace(self, finer=OVERSAMPLING)
        q, v, _ = fine._motion(reduced, fine._between)
        rows = [(sensor, reduced.point(sensor.point)) for sensor in self.test.sensors]
        shown = np.array([recorded(sensor, q @ row, v @ row, self.rate) for sensor, row in rows])
        return shown[:, : self.measured.shape[1]], q, v

    def begun(self, reduced: Structure) -> Self:
        """Return the run with states: those it has, or those of a simulation of the whole from standstill."""
        if self.states:
            return self
        whole = self._motion(reduced, self._between)
        firsts = [(a - REACH) * self.finer for a, _ in self.spans]
        states = tuple((whole[0][i], whole[1][i], whole[2][i]) for i in firsts)
        return replace(
            self, states=states, directions=moves_of(reduced, whole, SUBSTRUCTURE.band * self.rate)
        )

    @cached_property
    def _between(self) -> Array:
        """The drive between the samples, too, shape (finer·n,)."""
        return between_samples(self.drive, self.finer)

    def _missing(self, reduced: Structure) -> tuple[Array, ...]:
        """Return what the steps of the simulation leave out of every segment.

        That is what is missing of one with fine steps, and by Richardson's rule for order two of that. It hardly
        changes with the numbers of a fit, which may thus be sought with long steps (deferred correction: Fox, Proc. R.
        Soc. A 190, 1947).
        """
        middle, found = replace(self, finer=OVERSAMPLING), []
        fine = replace(middle, steps=FINER * middle.steps)
        for each in zip(self.spans, self.states, strict=True):
            less, more = middle._segment(reduced, *each), fine._segment(reduced, *each)
            found.append(less + (more - less) / (1 - 1 / FINER**2) - self._segment(reduced, *each))
        return tuple(found)

    def _settle(
        self, reduced: Structure, span: tuple[int, int], state: State, missing: Array, of_drive: Array | None
    ) -> tuple[State, Array, Array, Array]:
        """Return a segment's best state, what its errors explain, what moves it, and what errors of the drive do."""
        residual = self._segment(reduced, span, state) + missing
        away = (moved(state, [COARSE_DIFFERENCE], [move]) for move in self.directions)
        changes = [self._segment(reduced, span, each) + missing - residual for each in away]
        effects = np.array(changes).T / COARSE_DIFFERENCE
        count = effects.shape[1]
        if of_drive is None:
            of_drive = self._drive_effects(reduced, span, state, residual - missing)
        effects = np.hstack([effects, of_drive])
        left, size, right = np.linalg.svd(effects, full_matrices=False)
        pull = -(right.T[:count] * (size / (size**2 + 1))) @ left.T
        for _ in range(ROUNDS):
            trial = moved(state, pull @ residual, self.directions)
            after = self._segment(reduced, span, trial) + missing
            if after @ after >= residual @ residual:
                break
            state, residual = trial, after
        return state, left * np.sqrt(1 - 1 / np.sqrt(1 + size**2)), pull, of_drive

    def _drive_effects(self, reduced: Structure, span: tuple[int, int], state: State, shown: Array) -> Array:
        """Return what a standard error of each slow line of the drive does to a segment, shape (rows, lines)."""
        first, stop = span[0] - REACH, span[1] + REACH
        columns = []
        for line in slow_lines(stop - first, self.driven / self.rate).T:
            drive = self.drive.copy()
            drive[first:stop] += self.drive_sigma * line
            columns.append(replace(self, drive=drive)._segment(reduced, span, state) - shown)
        return np.array(columns).reshape(-1, shown.size).T

    def _motion(self, reduced: Structure, drive: Array, state: State | None = None) -> State:
        """Return the states under a drive, at each of its samples."""
        rate = self.finer * self.rate
        duration = (drive.size - 1) / rate
        found = trajectory(reduced, sampled(drive, rate), self.test.at, duration, self.steps * rate, state)
        return found[0][:: self.steps], found[1][:: self.steps], found[2][:: self.steps]

    def _segment(self, reduced: Structure, span: tuple[int, int], state: State) -> Array:
        """Return simulated less measured of a segment from a state, in the noise of the sensors, shape (rows,)."""
        return self._compared(span, self._simulated(reduced, span, state)[0])

    def _simulated(
        self, reduced: Structure, span: tuple[int, int], state: State, channels: Channels = RECORDED
    ) -> tuple[Array, State]:
        """Return what the sensors show of a segment from a state, shape (sensors, n), and the motion about it."""
        first, stop = span
        drive = self._between[(first - REACH) * self.finer : (stop + REACH - 1) * self.finer + 1]
        motion = self._motion(reduced, channels.pulse * drive, state)
        inside = slice(REACH, REACH + stop - first)
        rows = [(sensor, reduced.point(sensor.point)) for sensor in self.test.sensors]
        shown = np.array(
            [recorded(each, motion[0] @ row, motion[1] @ row, self.rate, self.finer) for each, row in rows]
        )
        if channels.delay:
            shown = np.array([delayed(each, channels.delay * self.rate) for each in shown])
        return channels.gain * shown[:, inside], motion

    def _compared(self, span: tuple[int, int], shown: Array) -> Array:
        """Return what the sensors show less measured in their noise, up to the frequency that is compared, (rows,)."""
        first, stop = span
        weighed = (shown - self.measured[:, first:stop]) / self.sigma[:, None]
        return np.asarray(scipy.fft.dct(weighed, norm="ortho", axis=1)[:, : kept(stop - first)].ravel())
