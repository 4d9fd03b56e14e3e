"""A model against a measured response: runs put right, their states, the simulation that answers them.

A diagnosis computes its gap on runs that were kept out of its fit by the same functions as a verification, so that the
saved model has that gap again.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import OF_CHANNELS, OF_RIG, TestNuisances
from sindyjoint.hooks import fetched
from sindyjoint.limits import RESPONSE
from sindyjoint.mechanics import FormulaLaw, Law
from sindyjoint.numeric import Array, scaled_least_squares
from sindyjoint.record import Campaign, Run
from sindyjoint.response.drive import Drive, prescribed
from sindyjoint.response.laws import Instant, LawInRun, law_in_run, parts_of, sum_law, with_added
from sindyjoint.response.run import WINDOW, SimulatedRun, along_motion, pooled_nrmse, simulate_run
from sindyjoint.states import (
    Choice,
    ForceStates,
    aligned_run,
    content_hash,
    force_states,
    mean_slope,
    one_after_another,
    states_of,
)

__getattr__ = fetched(
    __name__,
    {
        "drive": "prescribed simulate_segments",
        "laws": (
            "Instant LawInRun Part draw_models elastic_moment held_laws law_in_run law_terms model_law "
            "parts_of sum_law with_coefficients"
        ),
        "oscillations": "Oscillation compare_oscillations hilbert_envelope oscillation",
        "output_error": "OutputError",
        "output_error_runs": "Parameter term_columns",
        "refinement": "refine spread_starts undetermined_directions",
        "run": "along_motion measured_drive rest_of simulate_run",
        "verification": "Band RunVerification Verification",
        "verify_campaign": "cycle_energy",
    },
)


LawOf = Callable[[ForceStates], Law]


def compared_states(campaign: Campaign, runs: Sequence[Run], timed: bool) -> tuple[ForceStates, ...]:
    """Return the force states of runs, one after another.

    Parameters
    ----------
    campaign : Campaign
    runs : sequence of Run
        Of it.
    timed : bool
        Whether the law changes in time: then no run repeats, whatever its drive does.
    """
    method: Choice = "broadband" if timed else "auto"
    return one_after_another(campaign, states_of(campaign, runs, method))


def compare_run(
    law_of: LawOf,
    run: Run,
    states: ForceStates,
    window: float | None = WINDOW,
    free_run: int | None = None,
    response_only: bool = False,
) -> SimulatedRun:
    """Simulate the law of a run, by the motion where that was the drive.

    A free run has no steady state, whether it repeats or not; see :func:`~sindyjoint.response.run.simulate_run`.
    """
    law = law_of(states)
    drive: Drive | None = "motion" if prescribed(states, inertia=law.inertia) else None
    if free_run is not None:
        # Moments of one test depend on the time at which states begin.
        states = replace(force_states(run, "broadband"), began=states.began)
        law = law_of(states)
    return simulate_run(
        law, run, states, drive=drive, window=window, free_run=free_run, response_only=response_only
    )


def pooled_errors(runs: Sequence[SimulatedRun]) -> tuple[float, float]:
    """Return the relative RMS errors of moment and response of several runs; runs that failed are left out.

    NaN where none is left.
    """
    moments = [("moment", run.moment_nrmse, run.moment_scale) for run in runs]
    responses = [(run.channel, run.response_nrmse, run.response_scale) for run in runs]
    known = [[each for each in errors if each[1] == each[1]] for errors in (moments, responses)]
    return pooled_nrmse(known[0]), pooled_nrmse(known[1])


def simulated_gap(model: JointModel, campaign: Campaign, test: TestNuisances) -> float:
    """Return the response NRMSE over the validation runs, or all; NaN where a simulation fails."""
    return _gap_and_floor(model, campaign, test, WINDOW)[0]


def _gap_and_floor(
    model: JointModel, campaign: Campaign, test: TestNuisances, window: float | None
) -> tuple[float, float]:
    runs = {run.name: run for run in campaign.validation_runs or campaign.runs}
    found = [
        compare_run(
            lambda known: law_of_test(test, model, known), runs[states.run], states, window, None, True
        )
        for states in compared_states(campaign, list(runs.values()), False)
    ]
    errors = [(run.channel, run.response_nrmse, run.response_scale) for run in found]
    floors = [(run.channel, run.response_floor, run.response_scale) for run in found]
    return pooled_nrmse(errors), pooled_nrmse(floors)


def predicts_worse(
    before: JointModel, after: JointModel, campaign: Campaign, test: TestNuisances, window: float | None
) -> str:
    """Return in words by how much a model predicts runs kept out worse than another one; empty if it does not.

    What a law lacks goes into numbers that are fitted to its response, and is of the runs that they were fitted to. A
    difference within the noise of those kept out is none.
    """
    if not campaign.validation_runs:
        return ""
    (first, floor), (last, _) = (_gap_and_floor(model, campaign, test, window) for model in (before, after))
    if np.isnan(first) or last <= (1 + RESPONSE.minor_share) * np.hypot(first, np.nan_to_num(floor)):
        return ""
    missed = f"by {100 * last:.3g} %" if np.isfinite(last) else "altogether"
    return f"the runs kept out would be missed {missed}, where they are by {100 * first:.3g} % without it"


def corrected(test: TestNuisances, campaign: Campaign) -> Campaign:
    """Return the campaign with channels and inertia put right."""
    runs = tuple(_corrected_run(test, run) for run in campaign.runs)
    return replace(campaign, joint=test.joint_of(campaign.joint), runs=runs)


def _corrected_run(test: TestNuisances, run: Run) -> Run:
    drift = {test.drift.channel: test.drift.slopes.get(run.name, 0.0)} if test.drift else {}
    moment = run.moment - drift.get("moment_drift", 0.0) * run.time
    angle = run.angle - test.total("angle zero") - test.total("angle drift") * run.time
    angle = angle - drift.get("angle_drift", 0.0) * run.time
    moment, angle, gain = moment / test.gain("moment"), angle / test.gain("angle"), test.gain("angle")
    if np.any(angle != run.angle) or np.any(moment != run.moment):
        run = replace(run, angle=angle, moment=moment, rate=None if run.rate is None else run.rate / gain)
    delay = test.total("time shift")
    return aligned_run(run, delay) if delay else run


def carried_errors(model: JointModel | None, campaign: Campaign) -> tuple[TestNuisances, tuple[str, ...]]:
    """Return the errors of channels that a model knows of the rig of a campaign, and what is said of them."""
    none = TestNuisances("")
    if model is None or model.test is None or model.test.joint != campaign.joint.name:
        return none, ()
    carried = model.test.only(OF_CHANNELS)
    return carried, (f"put right, as the given model knows of this rig: {carried.words}",) if carried else ()


def put_right(
    usable: Campaign, given: Campaign, model: JointModel
) -> tuple[Campaign, TestNuisances, tuple[str, ...]]:
    """Return a campaign with what a model knows of its test put right, what is applied of that, and words for it.

    ``given`` is the campaign before anything was left out of it: by its content it is known. In another one of the same
    rig its errors are put right, and zero and drift of every run estimated anew.
    """
    test, none = model.test, TestNuisances("")
    if not test:
        return usable, none, ()
    if content_hash(given) == test.campaign:
        return corrected(test, usable), test, (f"put right, as found in this campaign: {test.words}",)
    if test.joint != given.joint.name:
        line = f"what was found in the test of {test.joint!r} is not applied to a campaign of {given.joint.name!r}"
        return usable, none, (f"{line}: {test.words}",)
    rig = test.only(OF_RIG)
    usable = corrected(rig, usable)
    usable, lines = _estimated_in_each(test.varies, rig, model, usable)
    if rig:
        lines = (f"put right, as found in another campaign of this rig: {rig.words}", *lines)
    if test.moments:
        moments = ", ".join(each.id.replace("_", " ") for each in test.moments)
        lines = (
            *lines,
            f"belongs to the campaign that it was found in, and is not applied to this one: {moments}",
        )
    return usable, rig, lines


def _estimated_in_each(
    varies: Sequence[str], rig: TestNuisances, model: JointModel, campaign: Campaign
) -> tuple[Campaign, tuple[str, ...]]:
    """Return a campaign with zero and drift of its channels estimated anew in each run, and what they came to.

    A drift of a run that repeats is that of the means of its periods. Otherwise zero and drift of the angle are those
    with which the law, its numbers held, comes nearest to the moment where the joint moves.
    """
    if not varies:
        return campaign, ()
    found = [_estimated_run(varies, rig, model, run) for run in campaign.runs]
    words = "; ".join(f"{run.name}: {text}" for run, text in found if text)
    return campaign.with_runs(tuple(run for run, _ in found)), (f"estimated anew in each run ({words})",)


def _estimated_run(varies: Sequence[str], rig: TestNuisances, model: JointModel, run: Run) -> tuple[Run, str]:
    states = force_states(run)
    known: dict[str, float] = {}
    for channel in ("moment", "angle"):
        if f"{channel} drift" in varies and states.method == "periodic":
            slope = mean_slope(getattr(run, channel), run.sample_rate, states)[3]
            run = replace(run, **{channel: getattr(run, channel) - slope * run.time})
            known[f"{channel} drift"] = slope
    left = [name for name in varies if name.startswith("angle") and name not in known]
    if left:
        values = np.zeros(len(left))
        # Gauss–Newton steps of a run's zero and drift: their columns change with the law's slope alone.
        for _ in range(4):
            states = force_states(run)
            step = _zero_step(law_of_test(rig, model, states), states, left)
            values += step
            run = replace(run, angle=run.angle - _line(left, step, run.time))
        known |= dict(zip(left, values.tolist(), strict=True))
    return run, ", ".join(f"{name} {value:.3g}" for name, value in known.items())


def _line(names: Sequence[str], values: Array, time: Array) -> Array:
    """Return the zero and drift of an angle over time."""
    powers = {"angle zero": 0, "angle drift": 1}
    return np.sum([v * time ** powers[n] for n, v in zip(names, values, strict=True)], axis=0)


def _zero_step(law: Law | LawInRun, states: ForceStates, names: Sequence[str]) -> Array:
    """Return the step of zero and drift of the angle that brings a law nearest to the moment."""
    size, states = 1e-3 * float(np.std(states.angle)), replace(states, lead=None)

    def moment(zero: Array) -> Array:
        return along_motion(law, replace(states, angle=states.angle - zero), states.sample_rate)[0][
            states.moving
        ]

    here = moment(np.zeros(states.n_samples))
    ends = size / np.array([1.0 if name == "angle zero" else states.time[-1] for name in names])
    units = np.diag(ends)
    columns = [
        (moment(_line(names, unit, states.time)) - here) / end for unit, end in zip(units, ends, strict=True)
    ]
    return scaled_least_squares(np.column_stack(columns), states.moment[states.moving] - here, 1e-9)


def law_of_test(test: TestNuisances, model: JointModel, states: ForceStates) -> Law | LawInRun:
    """Return the law of a model in one run of a test."""
    return with_added(
        law_in_run(replace(model, joint=test.joint_of(model.joint)), states), added_law(test, states)
    )


def added_law(test: TestNuisances, states: ForceStates) -> FormulaLaw | None:
    """Return the moments that a test adds in one of its runs; None where it adds none."""
    return sum_law(parts_of(test.moments), states.frequency or 0.0, Instant.of(states))
