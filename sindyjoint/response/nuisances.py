"""A test put right before a model is compared with it: errors of channels, and moments of time and frequency.

Delay and gain belong to the rig and are carried with the model. A zero and a drift belong to a run: in another campaign
than theirs they are estimated anew in each run, the law held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import OF_CHANNELS, OF_RIG, TestNuisances
from sindyjoint.mechanics.laws import FormulaLaw, Law
from sindyjoint.numeric import Array, scaled_least_squares
from sindyjoint.record import Campaign, Run
from sindyjoint.response.element_law import Instant, parts_of, sum_law
from sindyjoint.response.law_in_run import LawInRun, law_in_run, with_added
from sindyjoint.response.run import along_motion
from sindyjoint.states import ForceStates, force_states
from sindyjoint.states.campaigns import aligned_run, content_hash
from sindyjoint.states.repetition import mean_slope

# Gauss–Newton steps of a run's zero and drift: their columns change with the law's slope alone.
STEPS = 4


def belongs_to(test: TestNuisances, campaign: Campaign) -> bool:
    """Return whether this is the campaign that a test's nuisances were found in."""
    return content_hash(campaign) == test.campaign


def corrected(test: TestNuisances, campaign: Campaign) -> Campaign:
    """Return the campaign with channels and inertia put right."""
    runs = tuple(_corrected_run(test, run) for run in campaign.runs)
    return replace(campaign, joint=test.joint_of(campaign.joint), runs=runs)


def _corrected_run(test: TestNuisances, run: Run) -> Run:
    ramp = test.slopes.get(run.name, 0.0) * run.time
    moment, angle = run.moment, run.angle - test.total("angle zero") - test.total("angle drift") * run.time
    if test.drift == "moment_drift":
        moment = moment - ramp
    elif test.drift == "angle_drift":
        angle = angle - ramp
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
    if belongs_to(test, given):
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
        for _ in range(STEPS):
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
