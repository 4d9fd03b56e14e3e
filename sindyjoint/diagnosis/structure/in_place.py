"""A diagnosis from the runs of a structure: what the laws of its joints lack against what the structure lacks.

Which of the runs are fitted, and how they become a problem: those that do not repeat in segments beside those that do.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np

from sindyjoint.diagnosis.effects import Effect
from sindyjoint.diagnosis.effects.change import Change, joint_changes, structure_changes
from sindyjoint.diagnosis.effects.setup import Scales
from sindyjoint.diagnosis.parts import Place
from sindyjoint.diagnosis.policy import STRUCTURE, DiagnosisPolicy
from sindyjoint.diagnosis.problem import Problem
from sindyjoint.diagnosis.result import Diagnosis, Gap, InPlace, RecordGap
from sindyjoint.diagnosis.structure import fit
from sindyjoint.diagnosis.structure.gap import (
    cells_of_gap,
    locate_segments,
    segment_gaps,
    steady_gaps,
)
from sindyjoint.diagnosis.structure.kinds import JointKind, kinds_of, with_slopes
from sindyjoint.diagnosis.structure.problem import StructureProblem
from sindyjoint.diagnosis.structure.runs import RunsProblem, channels_of
from sindyjoint.diagnosis.structure.start import outside_joints
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.model_parts import range_warnings
from sindyjoint.equation.terms import Reference
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.mechanics.rig_test import RigRun, RigTest
from sindyjoint.numeric import Array, Booleans, main_frequency
from sindyjoint.record import SIMULATED
from sindyjoint.response.verify_campaign import GIVEN
from sindyjoint.states import ForceStates
from sindyjoint.substructure.harmonic_balance import SAMPLES_PER_HARMONIC
from sindyjoint.substructure.recovery import Recovery, held_spectra, stated_numbers, update_structure
from sindyjoint.substructure.simulated import SteadyRun
from sindyjoint.substructure.simulated.segments import SegmentedRun
from sindyjoint.substructure.states import joint_states, kept_of


def divide_runs(test: RigTest) -> tuple[list[RigRun], list[RigRun]]:
    """Return the runs that are fitted and those that are kept out: as they are marked, or every third one.

    Raises
    ------
    InputError
        Without a run for identification.
    """
    runs = list(test.identification_runs)
    if not runs:
        raise InputError("no run is for identification; expected at least one [[run]] with use = 'identify'")
    marked = [run for run in test.runs if run.use == "validate"]
    # Of fewer than four runs none is kept out unless it is marked.
    if marked or len(runs) < 4:
        return runs, marked
    return [run for i, run in enumerate(runs) if i % 3 != 1], runs[1::3]


def runs_problem(
    test: RigTest,
    recoveries: Sequence[Recovery],
    models: Mapping[str, JointModel],
    known: bool = False,
    policy: DiagnosisPolicy = STRUCTURE,
    fitted: bool = True,
    most: int | None = None,
) -> RunsProblem:
    """Return the problem of a test with a model for each kind of its joints.

    Runs that are ``fitted`` are weighed with the models, near whose motions others are sought; those that are kept out
    have motions near those recovered, whatever the model. The structure's numbers are updated by the runs whose joints
    stick. Of runs that do not repeat those segments are simulated in which joints move: the others tell of the
    structure's uncertain numbers alone, and are there where it has some. ``most``: as many in all, in which they move
    most, whose residuals are then weighed with the noise of the drive, too.

    Raises
    ------
    InputError
        Where a kind has no model, or the runs cannot be simulated with the models.
    """
    if not recoveries:
        raise InputError("no run repeats; the steady response is simulated of runs whose drive does")
    prior = update_structure(test, (), held_spectra(test)) if test.update_runs else None
    kinds = kinds_of(test, models, policy.granted_share)
    steady = tuple(SteadyRun.of(test, each) for each in recoveries if each.spectra.repeats)
    passing = [each for each in recoveries if not each.spectra.repeats]
    records = [SegmentedRun.of(test, each) for each in passing]
    if most is not None:
        count = max(1, most // max(len(records), 1))
        records = [r.liveliest(_joint_motion(each), count) for r, each in zip(records, passing, strict=True)]
    elif not test.uncertain:
        moving = [r.where(_moving(each)) for r, each in zip(records, passing, strict=True)]
        records = [record for record in moving if record.spans] or records
    problem = RunsProblem(
        test, kinds, prior or stated_numbers(test), steady, tuple(records), known, most is not None, policy=policy
    )  # fmt: skip
    return problem.whitened(problem.start()) if fitted else problem


def _states(recovery: Recovery) -> list[ForceStates]:
    """Return the states of all joints that move in a run."""
    joints = range(recovery.transfer.angles.shape[1])
    return [joint_states(recovery, joint, "") for joint in joints if kept_of(recovery, joint).any()]


def _joint_motion(recovery: Recovery) -> Array:
    """Return the size of the joints' rates over a run, each in its own RMS, shape (n,)."""
    rates = [state.rate / np.std(state.rate) for state in _states(recovery)]
    return np.asarray(np.linalg.norm(rates or recovery.run.responses, axis=0))


def _moving(recovery: Recovery) -> Booleans:
    """Return in which samples of a run any joint moves, shape (n,)."""
    states = [state.moving for state in _states(recovery)]
    return np.any(states, axis=0) if states else np.zeros(recovery.run.drive.size, dtype=np.bool_)


def joint_motions(problem: RunsProblem, x: Array) -> Iterator[tuple[str, Array, Array]]:
    """Yield the name of a run, and angle and rate of the joints over its period or a segment, shape (joints, n)."""
    for place, run in enumerate(problem.runs):
        found = problem.answer(place, x)
        if found is None:
            continue
        amplitudes = run.angles(found[0])
        orders = np.arange(amplitudes.shape[1])
        wave = np.exp(1j * np.outer(orders, np.linspace(0, 2 * np.pi, SAMPLES_PER_HARMONIC * orders.size)))
        yield run.name, (amplitudes @ wave).real, (1j * run.omega * orders * amplitudes @ wave).real
    for record in problem.records:
        with suppress(SimulationError, InputError):
            channels = channels_of(problem.setup(x))
            reduced = problem.simulated(record, x)
            for _, (angle, rate) in record.begun(reduced).motions(reduced, channels):
                yield record.name, angle.T, rate.T


def main_period(problem: RunsProblem) -> float:
    """Return the longest period of the strongest lines of the drives, or of what sensors show of other runs, s."""
    found = [2 * np.pi / (run.omega * (1 + int(np.argmax(np.abs(run.drive[1:]))))) for run in problem.runs]
    found += [1 / main_frequency(record.measured[0], record.rate) for record in problem.records]
    return max(found)


def beyond_tested(problem: RunsProblem) -> list[str]:
    """Return a warning for each run and joint that moves beyond what its model, as given, was tested to."""
    names = [hinge.name for hinge in problem.test.structure.hinges]
    motions: dict[str, list[tuple[Array, Array]]] = {}
    for name, angle, rate in joint_motions(problem, problem.start()):
        motions.setdefault(name, []).append((angle, rate))
    lines: list[str] = []
    for run, parts in motions.items():
        angle, rate = (np.concatenate(each, axis=1) for each in zip(*parts, strict=True))
        for kind in problem.kinds:
            fitted, motion = kind.model.fitted, kind.model.joint.motion
            for at in kind.places:
                lines += range_warnings(fitted, motion, angle[at], rate[at], f"{GIVEN}{run}, {names[at]}")
    return lines


@dataclass(frozen=True, eq=False)
class RunsDiagnosis(StructureProblem):
    """The runs of a structure, with the effects added so far.

    Parameters
    ----------
    pulse : RunsProblem
    kept : RunsProblem or None
        Runs that no fit sees.
    """

    pulse: RunsProblem  # type: ignore[assignment]
    kept: RunsProblem | None = None

    @classmethod
    def of(cls, problem: RunsProblem, kept: RunsProblem | None, effects: Sequence[Effect]) -> "RunsDiagnosis":
        """Return the diagnosis of a problem, whose numbers are fitted first.

        Raises
        ------
        InputError
            Where the runs cannot be simulated.
        """
        best = fit(problem, problem.start(), problem.duration)
        if best is None:
            raise InputError("the runs cannot be simulated with the models and their uncertainty")
        if not problem.known:
            # Laws that were found in the same runs: weighed, and searched from, where they fit best.
            problem = problem.whitened(best.x)
            best = fit(problem, best.x, problem.duration) or best
        # Laws with effects are known to the kinds of the fitted runs.
        kept = None if kept is None else replace(kept, kinds=problem.kinds, _kept={})
        beyond = [line for each in (problem, kept) if each and each.known for line in beyond_tested(each)]
        return cls(problem, best, candidates(problem, best.x, effects), 1.0, kept=kept, beyond=tuple(beyond))

    @cached_property
    def records(self) -> tuple[RecordGap, ...]:
        """Every sensor of every run beside the simulations; of those that were kept out, where there are any."""
        shown = self.kept or self.pulse
        given = replace(shown, found=())
        after = replace(shown, found=self.pulse.found)
        found = [each for gaps in (steady_gaps, segment_gaps) for each in gaps(given, after, self.best.x)]
        return tuple(
            sorted(found, key=lambda each: -each.gap_after if each.gap_after == each.gap_after else 0.0)
        )

    def pooled(self, name: str) -> Gap:
        """Return the RMS of gaps that are relative to each record, each record counting as its own square."""
        size = np.array([float(np.sum(record.measured**2)) for record in self.records])
        values = np.array([getattr(record, name) for record in self.records])
        alike = len({record.unit for record in self.records}) == 1
        weight = size / size.sum() if alike else np.full(size.size, 1 / size.size)
        return Gap(float("nan"), float(np.sqrt(weight @ values**2)))

    drags: ClassVar[bool] = True

    def power(self) -> tuple[float, float]:
        """Return the squares of what the sensors show, in units of noise; no time step has an error there."""
        own = sum(float(np.sum(np.abs(run.measured / run.sigma) ** 2)) for run in self.pulse.runs)
        return own + sum(record.power for record in self.pulse.records), 0.0

    def places(self) -> tuple[Place, ...]:
        """Return in which run, at which sensor and at which harmonic the gap of the given models lies."""
        if not self.pulse.runs:
            return locate_segments(self.pulse)
        names, square = [], []
        for place, run in enumerate(self.pulse.runs):
            found = self.pulse.answer(place, self.pulse.start())
            if found is not None:
                names.append(run.name)
                square.append(np.maximum(np.abs((found[1] - run.measured) / run.sigma) ** 2 - 2, 0.0))
        if not square:
            return ()
        count = min(each.shape[1] for each in square)
        axes = (("run", "in run", 0, names), ("sensor", "at sensor", 1, [s.name for s in self.pulse.test.sensors]),
                ("harmonic", "at harmonic", 2, [str(order) for order in range(1, count + 1)]))  # fmt: skip
        return cells_of_gap(np.array([each[:, :count] for each in square]), "harmonics", axes, self.policy)

    # Further runs of a structure are not searched for.
    separating_runs = Problem.separating_runs

    def diagnosis(self, first: "RunsDiagnosis", found: Mapping[str, Any]) -> Diagnosis:
        """Return the result: the model of each kind of joint, and the structure's numbers."""
        problem, x = self.pulse, self.best.x
        covariance = problem.covariance(x)
        changed = [change.kind for change in problem.found if change.inside]

        def assembled(kind: JointKind, values: Array) -> JointModel:
            setup = problem.setup(values)
            return kind.whole(setup.kinds[kind.name].numbers, kind.model, problem.found)

        high = problem.bounds()[1]
        models = {
            kind.name: with_slopes(partial(assembled, kind), x, high, covariance) for kind in problem.kinds
        }
        lead = changed[0] if changed else problem.kinds[0].name
        count = sum(len(record.spans) for record in problem.records)
        said = [
            (problem.test.simulated, SIMULATED),
            (
                problem.records,
                f"of runs that do not repeat {count} segments are compared, in which the joints move most",
            ),
            (
                not self.kept,
                "no run was kept out of the fit: the gaps are those of the fitted runs; mark one use = 'validate'",
            ),
        ]
        return Diagnosis(
            **found,
            warnings=(*(words for so, words in said if so), *self.beyond),
            model=models[lead],
            whole=models[lead],
            source="structure",
            rig=problem.test.name,
            records=self.records,
            in_place=InPlace(lead, models, problem.update(x, covariance)),
        )


def candidates(problem: RunsProblem, x: Array, effects: Sequence[Effect]) -> tuple[Change, ...]:
    """Return the ways in which the structure, and each kind of joint, may differ from what is described."""
    setup = problem.setup(x)
    # Accelerometers see neither zero nor drift.
    changes = list(structure_changes(outside_joints(effects), setup, Scales(main_period(problem))))
    laws = problem.laws(setup)
    motions = list(joint_motions(problem, x))
    for kind in problem.kinds:
        peaks = np.zeros(3)
        for _, angles, rates in motions:
            for place in kind.places:
                law, d, v = laws[place], angles[place], rates[place]
                moment = law.moment(d, v, np.sign(v))
                peaks = np.maximum(peaks, np.abs([d, v, moment]).max(axis=1))
        angle, rate, moment = peaks.tolist()
        own = joint_changes(kind.laws, effects, Reference(angle, rate), moment)
        changes += [kind.change(change, len(problem.kinds) > 1) for change in own]
    return tuple(changes)
