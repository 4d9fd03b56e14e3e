"""Runs of a structure as an output-error problem, those that do not repeat in segments beside those that do."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.effects.change import Change
from sindyjoint.diagnosis.effects.setup import Setup
from sindyjoint.diagnosis.policy import STRUCTURE, DiagnosisPolicy
from sindyjoint.diagnosis.structure import STEP_PRIOR, covariance_of, differences, parted
from sindyjoint.diagnosis.structure.runs import RunsProblem
from sindyjoint.equation.calibration import widened
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.limits import SUBSTRUCTURE
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.mechanics.structure import Structure
from sindyjoint.numeric import COARSE_DIFFERENCE, Array
from sindyjoint.states import ForceStates
from sindyjoint.substructure.recovery import Recovery
from sindyjoint.substructure.simulated.segment_parts import Channels
from sindyjoint.substructure.simulated.segments import SegmentedRun
from sindyjoint.substructure.states import joint_states, kept_of

# Neighbouring lines whose residuals count as one: what a law lacks is alike in so many, and hundreds of groups remain.
LINES = 10


@dataclass(frozen=True, eq=False)
class RecordsProblem(RunsProblem):
    """Runs that repeat, with the numbers of all, and runs that do not.

    Parameters
    ----------
    records : tuple of SegmentedRun
    floored : bool
        Whether their residuals are weighed with the noise of the drive, too.
    """

    records: tuple[SegmentedRun, ...] = ()
    floored: bool = False

    def rows(self, duration: float | None = None) -> float:
        """Return the number of residuals."""
        return super().rows() + sum(record.rows for record in self.records)

    @property
    def groups(self) -> NDArray[np.intp]:
        """Of each residual what is predicted together from the others."""
        steady = super().groups
        return np.append(steady, len(steady) + 1 + parted([record.rows for record in self.records]))

    def residuals(self, x: Array, duration: float = 0.0, extra: Change | None = None) -> Array | None:
        """Return simulated less measured in units of noise, prior rows among them; None without a motion."""
        first, parts = super().residuals(x, duration, extra), self._segments(x, extra)
        return None if first is None or parts is None else np.concatenate([first, *parts])

    def _segments(self, x: Array, extra: Change | None = None) -> list[Array] | None:
        """Return the residual of every segment; None without a motion."""
        records = self._following(x, extra)
        return None if records is None else self._residual_of(records, x, extra)

    def _following(self, x: Array, extra: Change | None) -> tuple[SegmentedRun, ...] | None:
        """Return the runs, their states moved after the numbers; of a diagnosis as they are, for it tries many."""
        if self.floored:
            return self.records
        key = "following", x.tobytes(), id(extra), tuple(map(id, self.found))
        if key not in self._kept:
            found = None
            with suppress(SimulationError, InputError, np.linalg.LinAlgError):
                setup = self.setup(x, extra)
                found = tuple(
                    record.followed(self.simulated(record, x, setup), channels_of(setup))
                    for record in self.records
                )
            self._keep(key, found)
        return self._kept[key]

    def _residual_of(
        self, records: tuple[SegmentedRun, ...], x: Array, extra: Change | None
    ) -> list[Array] | None:
        """Return the residual of every segment of runs; None without a motion."""
        key = "segments", x.tobytes(), id(extra), tuple(map(id, self.found)), tuple(map(id, records))
        if key in self._kept:
            return self._kept[key]
        found = None
        with suppress(SimulationError, InputError, np.linalg.LinAlgError):
            setup = self.setup(x, extra)
            found = [
                part
                for record in records
                for part in record.residual(self.simulated(record, x, setup), channels_of(setup))
            ]
        return self._keep(key, found)

    def simulated(self, record: SegmentedRun, x: Array, setup: Setup | None = None) -> Structure:
        """Return the structure that is simulated of a run.

        Raises
        ------
        InputError
            Where a number is not finite, or a clamp bends that did not: the segments' states would be others.
        """
        setup = self.setup(x) if setup is None else setup
        if not all(np.isfinite(value) for own in setup.kinds.values() for value in own.numbers.values()):
            raise InputError("a number of the law is not finite")
        structure = self.structure(setup, x)
        if len(structure.mass) != len(record.basis):
            raise InputError("the structure has other coordinates")
        return record.reduced(structure, self.laws(setup))

    def derivatives(
        self, x: Array, residual: Array, duration: float, places: Sequence[int], extra: Change | None = None
    ) -> Array:
        """Return the columns of the Jacobian at some places, those of the segments by differences."""
        low, high = self.bounds(extra)
        steps = COARSE_DIFFERENCE * (high - low)
        steps[: self.priors] = STEP_PRIOR
        return self._columns(x, residual, duration, places, steps, extra)

    def _columns(
        self,
        x: Array,
        residual: Array,
        duration: float,
        places: Sequence[int],
        steps: Array,
        extra: Change | None = None,
    ) -> Array:
        first = residual.size - sum(record.rows for record in self.records)
        columns = np.zeros((residual.size, len(places)))
        columns[:first] = super().derivatives(x, residual[:first], duration, places, extra)
        records = self._following(x, extra)

        def segments(at: Array) -> Array | None:
            parts = None if records is None else self._residual_of(records, at, extra)
            return None if parts is None else np.concatenate(parts)

        columns[first:] = differences(segments, x, residual[first:], places, steps, self.bounds(extra)[1])
        return columns

    def near(self, x: Array) -> Self:
        """Return the problem for a first look round some numbers: itself."""
        return self

    def whitened(self, x: Array, extra: Change | None = None) -> "RecordsProblem":
        """Return the problem with residuals weighed at some numbers, and segments that begin where they fit best.

        Raises
        ------
        InputError
            Where a run cannot be simulated there.
        """
        steady, records = super().whitened(x, extra), []
        assert isinstance(steady, RecordsProblem)
        for record in self.records:
            try:
                reduced = self.simulated(record, x, self.setup(x, extra))
                driven = bool(record.states) and not self.floored
                known = record.followed(reduced).with_measured_noise(reduced) if driven else record
                settled = known.settled(reduced, driven)
                if self.floored:
                    settled = settled.with_measured_noise(reduced).with_noise_of_drive(reduced)
                records.append(settled)
            except SimulationError as error:
                raise InputError(
                    f"run {record.name!r} cannot be simulated with the model: {error}"
                ) from error
        return replace(steady, records=tuple(records), _kept={})

    def covariance(self, x: Array) -> Array:
        """Return the covariance of the numbers: H⁻¹·S·H⁻¹, no less than H⁻¹, with H = JᵀJ and S the scatter of scores.

        Of runs that do not repeat a score is the sum of Jᵀr over all sensors and `LINES` neighbouring lines of a
        segment: what noise of the drive does through the structure, and what the law lacks, is alike in these and no
        white noise of the sensors (White, Econometrica 48(4), 1980; by groups: Liang and Zeger, Biometrika 73(1),
        1986). Prior and runs that repeat are whitened already.
        """
        residual = self.residuals(x)
        assert residual is not None
        jacobian = self.derivatives(x, residual, 0.0, range(x.size))
        # Events bend the response within the errors that the numbers had before the fit, which may be much larger.
        errors = np.sqrt(np.diag(covariance_of(jacobian)))
        jacobian = self._columns(x, residual, 0.0, range(x.size), STEP_PRIOR * np.minimum(errors, 1.0))
        inverse = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
        at = residual.size - sum(record.rows for record in self.records)
        scatter = jacobian[:at].T @ jacobian[:at]
        for record in self.records:
            for first, stop in record.spans:
                own = slice(at, at + record.segment_rows(first, stop))
                by_row = (jacobian[own] * residual[own, None]).reshape(len(record.sigma), -1, x.size)
                scores = np.add.reduceat(by_row.sum(axis=0), np.arange(0, by_row.shape[1], LINES))
                scatter, at = scatter + scores.T @ scores, own.stop
        known = np.maximum(np.diag(inverse), 1e-300)
        wider = np.sqrt(np.maximum(np.diag(inverse @ scatter @ inverse) / known, 1.0))
        return np.asarray(inverse * np.outer(wider, wider))

    def models(self, x: Array, covariance: Array) -> dict[str, JointModel]:
        """Return the model of each kind, whose terms are no surer than a simulation in segments is exact."""
        found = super().models(x, covariance)
        return {
            kind: widened(model, np.diag((SUBSTRUCTURE.simulated * model.coefficients) ** 2))
            for kind, model in found.items()
        }


def channels_of(setup: Setup) -> Channels:
    """Return what a setup makes of drive and sensors."""
    return Channels(setup.pulse, setup.gain, setup.delay)


def runs_problem(
    test: RigTest,
    recoveries: Sequence[Recovery],
    models: Mapping[str, JointModel],
    known: bool = False,
    policy: DiagnosisPolicy = STRUCTURE,
    fitted: bool = True,
    most: int | None = None,
) -> RunsProblem:
    """Return the problem of runs that repeat and runs that do not; parameters as of :meth:`RunsProblem.of`.

    Of runs that do not repeat those segments are simulated in which joints move: the others tell of the structure's
    uncertain numbers alone, and are there where it has some. ``most``: as many in all, in which they move most, whose
    residuals are then weighed with the noise of the drive, too.
    """
    passing = [each for each in recoveries if not each.spectra.repeats]
    if not passing:
        return RunsProblem.of(test, recoveries, models, known, policy, fitted)
    if len(passing) < len(recoveries):
        steady = RunsProblem.of(test, recoveries, models, known, policy, fitted=False)
    else:
        steady = replace(RunsProblem.with_models(test, models, policy), known=known)
    records = [SegmentedRun.of(test, each) for each in passing]
    if most is not None:
        count = max(1, most // len(records))
        records = [r.liveliest(_joint_motion(each), count) for r, each in zip(records, passing, strict=True)]
    elif not test.uncertain:
        moving = [r.where(_moving(each)) for r, each in zip(records, passing, strict=True)]
        records = [record for record in moving if record.spans] or records
    own = {each.name: getattr(steady, each.name) for each in fields(steady) if each.name != "_kept"}
    problem = RecordsProblem(**own, records=tuple(records), floored=most is not None)
    return problem.whitened(problem.start()) if fitted else problem


def _states(recovery: Recovery) -> list[ForceStates]:
    """Return the states of all joints that move in a run."""
    joints = range(recovery.transfer.angles.shape[1])
    return [joint_states(recovery, joint, "") for joint in joints if kept_of(recovery, joint).any()]


def _joint_motion(recovery: Recovery) -> Array:
    """Return the size of the joints' rates over a run, each in its own RMS, shape (n,)."""
    rates = [state.rate / np.std(state.rate) for state in _states(recovery)]
    return np.asarray(np.linalg.norm(rates or recovery.run.responses, axis=0))


def _moving(recovery: Recovery) -> NDArray[np.bool_]:
    """Return in which samples of a run any joint moves, shape (n,)."""
    states = [state.moving for state in _states(recovery)]
    return np.any(states, axis=0) if states else np.zeros(recovery.run.drive.size, dtype=np.bool_)
