"""The runs of a structure as an output-error problem: laws of its joints, its own numbers, effects added so far.

Of a run that repeats the steady motion is that of harmonic balance; derivatives follow from the balance itself, without
a further simulation. One that does not repeat is simulated in segments. Unknown are the laws' numbers, the structure's
uncertain numbers under the priors that its file states (as the runs whose joints stick have updated them), and the
numbers of effects.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from sindyjoint.clock import spend
from sindyjoint.diagnosis.effects.change import Change
from sindyjoint.diagnosis.effects.setup import Setup
from sindyjoint.diagnosis.policy import STRUCTURE, DiagnosisPolicy
from sindyjoint.diagnosis.structure import (
    STEP_PRIOR,
    Made,
    OutputError,
    attempted,
    covariance_of,
    differences,
    parted,
)
from sindyjoint.diagnosis.structure.kinds import JointKind
from sindyjoint.equation.calibration import widened
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.limits import SUBSTRUCTURE
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.mechanics.structure import Hinge, Structure
from sindyjoint.numeric import COARSE_DIFFERENCE, Array, Complex, Integers
from sindyjoint.substructure.recovery import Update, with_numbers
from sindyjoint.substructure.simulated import Answer, SteadyRun
from sindyjoint.substructure.simulated.segment_parts import Channels
from sindyjoint.substructure.simulated.segments import SegmentedRun
from sindyjoint.substructure.steady_response import Steady


@dataclass(frozen=True, eq=False)
class RunsProblem(OutputError):
    """Runs of a structure, models in its joints, and the effects named so far.

    Parameters
    ----------
    test : RigTest
        As it is described.
    kinds : tuple of JointKind
    prior : Update
        The structure's uncertain numbers as the file states them, or by the runs whose joints stick.
    runs : tuple of SteadyRun
        Those that repeat.
    records : tuple of SegmentedRun
        Those that do not.
    known : bool
        Whether the laws' numbers keep to their covariance, as where they come from another test.
    floored : bool
        Whether residuals of the records are weighed with the noise of the drive, too.
    found : tuple of Change
    policy : DiagnosisPolicy
    near_to : tuple of Answer
        Of each run that repeats a motion from which others are moved to first order; empty where they are sought.
    """

    test: RigTest
    kinds: tuple[JointKind, ...]
    prior: Update
    runs: tuple[SteadyRun, ...] = ()
    records: tuple[SegmentedRun, ...] = ()
    known: bool = False
    floored: bool = False
    found: tuple[Change, ...] = ()
    policy: DiagnosisPolicy = STRUCTURE
    near_to: tuple[Answer, ...] = ()
    _kept: dict[object, Any] = field(default_factory=dict, repr=False)

    #: No horizon: a steady state is compared as a whole, and so are segments.
    duration: ClassVar[float] = 0.0

    def rows(self, duration: float | None = None) -> float:
        """Return the number of residuals."""
        return float(sum(r.rows for r in self.runs) + sum(r.rows for r in self.records))

    @property
    def groups(self) -> Integers:
        """Of each residual what is predicted together from the others: runs, the priors, and parts of records."""
        steady = parted([run.rows for run in self.runs])
        steady = np.append(steady, np.full(self._held, len(steady)))
        return np.append(steady, len(steady) + 1 + parted([record.rows for record in self.records]))

    @property
    def numbers(self) -> int:
        """How many uncertain numbers the structure has."""
        return len(self.test.uncertain)

    @property
    def priors(self) -> int:
        """Numbers of structure and laws, which come first."""
        return self.numbers + sum(kind.size for kind in self.kinds)

    @property
    def _held(self) -> int:
        """How many of these, the first ones, keep to a prior."""
        return self.priors if self.known else self.numbers

    @property
    def free(self) -> Array:
        """How far each number with a prior may move, in its standard errors; laws' numbers without one, further."""
        return np.repeat([8.0, 300.0], [self._held, self.priors - self._held])

    def parts(self, x: NDArray[Any]) -> dict[str, NDArray[Any]]:
        """Return the numbers of each kind among those of the base."""
        ends = np.cumsum([self.numbers, *(kind.size for kind in self.kinds)])
        return {k.name: x[a:b] for k, a, b in zip(self.kinds, ends[:-1], ends[1:], strict=True)}

    def changes(self, x: Array) -> Array:
        """Return the relative changes of the structure's uncertain numbers."""
        return self.prior.change + self._root @ x[: self.numbers]

    @cached_property
    def _root(self) -> Array:
        """L of the prior covariance L·Lᵀ of the structure's uncertain numbers."""
        return np.asarray(np.linalg.cholesky(self.prior.covariance))

    def setup(self, x: Array, extra: Change | None = None) -> Setup:
        """Return the setup of some numbers."""
        own = self.parts(x)
        chain = self.test.chain
        setup = Setup(
            chain.items if chain else (), 1 / chain.clamp_stiffness if chain else 0.0, {},
            kinds={kind.name: kind.setup(own[kind.name]) for kind in self.kinds},
        )  # fmt: skip
        return self.changed(setup, x, extra)

    def structure(self, setup: Setup, x: Array) -> Structure:
        """Return the structure of a setup."""
        chain, test = self.test.chain, self.test
        if chain and (setup.items != chain.items or setup.compliance != 1 / chain.clamp_stiffness):
            clamp = np.inf if setup.compliance <= 0 else 1 / setup.compliance
            test = replace(
                test, structure=replace(chain, items=setup.items, clamp_stiffness=clamp).assembled()
            )
        return with_numbers(test, self.changes(x)).structure if self.numbers else test.structure

    def laws(self, setup: Setup) -> tuple[Any, ...]:
        """Return the law of every joint.

        Raises
        ------
        InputError
            Where a number is not finite.
        """
        if not all(np.isfinite(value) for own in setup.kinds.values() for value in own.numbers.values()):
            raise InputError("a number of the law is not finite")
        laws = {kind.name: kind.laws.law(setup.kinds[kind.name]) for kind in self.kinds}
        return tuple(laws[kind] for kind in self.test.kinds)

    def balance(self, run: SteadyRun, x: Array, setup: Setup) -> Steady:
        """Return the balance of a run; most candidates leave the structure at its harmonics as it is."""
        # About as long as a harmonic balance takes, by joint, in samples of a trial.
        spend(2e4 * self.test.structure.n_joints)
        rest = tuple(item for item in setup.items if not isinstance(item, Hinge))

        def condensed() -> Any:
            structure = self.structure(setup, x)
            return structure, run.condensed(structure)

        key = "structure", run.omega, rest, setup.compliance, x[: self.numbers].tobytes()
        structure, at_harmonics = self._once(key, condensed)
        return run.balance(structure, self.laws(setup), at_harmonics, setup.pulse)

    def _tried(self, name: object, x: Array, extra: Change | None, make: Callable[[], Made]) -> Made | None:
        """Return what is made with some numbers, once; None without a motion."""
        key = name, x.tobytes(), id(extra), tuple(map(id, self.found))
        return self._once(key, lambda: attempted(make))

    def answer(self, place: int, x: Array, extra: Change | None = None) -> tuple[Answer, Complex] | None:
        """Return the motion of a run and what its sensors record; None where there is none.

        Near a known motion this one is returned, and what the sensors record of the motion moved from it.
        """
        run = self.runs[place]

        def found() -> tuple[Answer, Complex]:
            setup = self.setup(x, extra)
            balance = self.balance(run, x, setup)
            answer = self.near_to[place] if self.near_to else run.answer(balance)
            shown = run.moved(answer, balance) if self.near_to else answer.shown
            return answer, run.recorded(shown, channels_of(setup))

        return self._tried(place, x, extra, found)

    def answers(self, x: Array, extra: Change | None = None) -> list[tuple[Answer, Complex]] | None:
        """Return those of all runs that repeat; None where one has none."""
        found = [self.answer(place, x, extra) for place in range(len(self.runs))]
        whole = [each for each in found if each is not None]
        return whole if len(whole) == len(found) else None

    def residuals(self, x: Array, duration: float = 0.0, extra: Change | None = None) -> Array | None:
        """Return simulated less measured in units of noise, prior rows among them; None without a motion.

        Run by run those that repeat, then the priors, then segment by segment.
        """
        answers, segments = self.answers(x, extra), self._segments(self._following(x, extra), x, extra)
        if answers is None or segments is None:
            return None
        parts = (run.residual(shown) for run, (_, shown) in zip(self.runs, answers, strict=True))
        return np.concatenate([*parts, x[: self._held], segments])

    def _following(self, x: Array, extra: Change | None) -> tuple[SegmentedRun, ...] | None:
        """Return the records, their states moved after the numbers; of a diagnosis as they are, for it tries many."""

        def followed() -> tuple[SegmentedRun, ...]:
            setup = self.setup(x, extra)
            return tuple(
                record.followed(self.simulated(record, x, setup), channels_of(setup))
                for record in self.records
            )

        moving = self.records and not self.floored
        return self._tried("following", x, extra, followed) if moving else self.records

    def _segments(
        self, records: tuple[SegmentedRun, ...] | None, x: Array, extra: Change | None
    ) -> Array | None:
        """Return the residual of all segments of some records; None without a motion."""
        if records is None:
            return None

        def residual() -> Array:
            setup = self.setup(x, extra)
            shown = ((r, self.simulated(r, x, setup)) for r in records)
            parts = (part for r, reduced in shown for part in r.residual(reduced, channels_of(setup)))
            return np.concatenate([np.empty(0), *parts])

        return self._tried(("segments", *map(id, records)), x, extra, residual)

    def simulated(self, record: SegmentedRun, x: Array, setup: Setup | None = None) -> Structure:
        """Return the structure that is simulated of a run.

        Raises
        ------
        InputError
            Where a number is not finite, or a clamp bends that did not: the segments' states would be others.
        """
        setup = self.setup(x) if setup is None else setup
        structure = self.structure(setup, x)
        if len(structure.mass) != len(record.basis):
            raise InputError("the structure has other coordinates")
        return record.reduced(structure, self.laws(setup))

    def derivatives(
        self,
        x: Array,
        residual: Array,
        duration: float,
        places: Sequence[int],
        extra: Change | None = None,
        steps: Array | None = None,
    ) -> Array:
        """Return the columns of the Jacobian at some places, shape (rows, len(places)), from the balance of runs.

        ``steps``: of the differences by which those of segments are taken.
        """
        low, high = self.bounds(extra)
        if steps is None:
            steps = COARSE_DIFFERENCE * (high - low)
            steps[: self.priors] = STEP_PRIOR
        answers = self.answers(x, extra)
        if answers is None:
            return np.zeros((residual.size, len(places)))
        exactly, coarse, columns = bool(self.near_to) or extra is None, np.full(x.size, COARSE_DIFFERENCE), []
        for run, (answer, shown) in zip(self.runs, answers, strict=True):

            def moved(at: Array, run: SteadyRun = run, answer: Answer = answer) -> Array:
                setup = self.setup(at, extra)
                there = run.moved(answer, self.balance(run, at, setup), exactly)
                return run.residual(run.recorded(there, channels_of(setup)))

            columns.append(
                differences(partial(attempted, moved), x, run.residual(shown), places, coarse, high)
            )
        columns.append(np.equal.outer(np.arange(self._held), places).astype(float))
        rest, records = residual[sum(map(len, columns)) :], self._following(x, extra)
        columns.append(
            differences(lambda at: self._segments(records, at, extra), x, rest, places, steps, high)
        )
        return np.vstack(columns)

    def covariance(self, x: Array) -> Array:
        """Return the covariance of the base's numbers.

        Of runs that repeat (JᵀJ)⁻¹, larger by χ² per degree of freedom above one. Of others H⁻¹·S·H⁻¹, no less than
        H⁻¹, with H = JᵀJ and S the scatter of scores (White, Econometrica 48(4), 1980), which is H of the prior and of
        runs that repeat: these are whitened already.
        """
        residual = self.residuals(x)
        assert residual is not None
        jacobian = self.derivatives(x, residual, 0.0, range(x.size))
        linear = covariance_of(jacobian)
        if not self.records:
            degrees = max(self.rows() - x.size, 1.0)
            return np.asarray(linear * max(1.0, float(residual @ residual) / degrees))
        # Events bend the response within the errors that the numbers had before the fit, which may be much larger.
        steps = STEP_PRIOR * np.minimum(np.sqrt(np.diag(linear)), 1.0)
        jacobian = self.derivatives(x, residual, 0.0, range(x.size), steps=steps)
        inverse = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
        rows = np.cumsum([residual.size - sum(r.rows for r in self.records), *(r.rows for r in self.records)])
        steady, *parts = zip(np.split(jacobian, rows[:-1]), np.split(residual, rows[:-1]), strict=True)
        scatter = steady[0].T @ steady[0]
        for record, part in zip(self.records, parts, strict=True):
            scatter = scatter + record.scatter(*part)
        known = np.maximum(np.diag(inverse), 1e-300)
        wider = np.sqrt(np.maximum(np.diag(inverse @ scatter @ inverse) / known, 1.0))
        return np.asarray(inverse * np.outer(wider, wider))

    def models(self, x: Array, covariance: Array) -> dict[str, JointModel]:
        """Return the model of each kind with the numbers of the base, whose covariance is given.

        Terms are no surer than a simulation in segments is exact.
        """
        places, share = self.parts(np.arange(x.size)), SUBSTRUCTURE.simulated if self.records else 0.0
        found = {
            kind.name: kind.with_numbers(x[own], covariance[np.ix_(own, own)])
            for kind, own in zip(self.kinds, places.values(), strict=True)
        }
        return {
            kind: widened(model, np.diag((share * model.coefficients) ** 2)) for kind, model in found.items()
        }

    def update(self, x: Array, covariance: Array) -> Update | None:
        """Return the structure's uncertain numbers; None where it has none."""
        own = self._root @ covariance[: self.numbers, : self.numbers] @ self._root.T
        return replace(self.prior, change=self.changes(x), covariance=own) if self.numbers else None

    def near(self, x: Array) -> Self:
        """Return the problem whose motions are those at some numbers moved to first order: quick, for a first look.

        Segments have no such motions: with them it is the problem itself.
        """
        answers = self.answers(x)
        if answers is None or self.records:
            return self
        return replace(self, near_to=tuple(answer for answer, _ in answers), _kept={})

    def whitened(self, x: Array, extra: Change | None = None) -> Self:
        """Return the problem with residuals weighed at some numbers, and motions and states sought near those there.

        Raises
        ------
        InputError
            Where a run cannot be simulated there.
        """
        setup = self.setup(x, extra)
        structure, runs, records = self.structure(setup, x), [], []
        for place, run in enumerate(self.runs):
            found = self.answer(place, x, extra)
            if found is None:
                raise InputError(
                    f"run {run.name!r}: no steady motion is found with the model near the one that was recovered"
                )
            runs.append(run.begun_at(found[0], structure))
        for record in self.records:
            try:
                reduced = self.simulated(record, x, setup)
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
        return replace(self, runs=tuple(runs), records=tuple(records), _kept={})


def channels_of(setup: Setup) -> Channels:
    """Return what a setup makes of drive and sensors."""
    return Channels(setup.pulse, setup.gain, setup.delay)
