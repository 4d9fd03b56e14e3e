"""The runs of a test that are fitted, and their problem: those that do not repeat in segments beside those that do."""

from collections.abc import Mapping, Sequence

import numpy as np

from sindyjoint.diagnosis.policy import STRUCTURE, DiagnosisPolicy
from sindyjoint.diagnosis.structure.kinds import kinds_of
from sindyjoint.diagnosis.structure.runs import RunsProblem
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError
from sindyjoint.mechanics.rig_test import RigRun, RigTest
from sindyjoint.numeric import Array, Booleans
from sindyjoint.states import ForceStates
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
