"""A model against the runs of a campaign."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.equation.model_parts import has_seen, range_warnings
from sindyjoint.equation.test_record import TestNuisances
from sindyjoint.errors import InputError
from sindyjoint.limits import RESPONSE
from sindyjoint.numeric import Array, finite
from sindyjoint.record import Campaign, Run
from sindyjoint.response import compare_run, compared_states, law_of_test
from sindyjoint.response.laws import as_followed
from sindyjoint.response.oscillations import compare_oscillations, oscillation
from sindyjoint.response.run import SimulatedRun
from sindyjoint.response.verification import (
    Band,
    RunVerification,
    Settings,
    Verification,
    band_of,
    judged,
    seen_words,
)
from sindyjoint.states import ForceStates, run_hash
from sindyjoint.text import Quantities, in_words_of, quantities


def verify_campaign(
    model: JointModel,
    campaign: Campaign,
    settings: Settings,
    say: Callable[[str], None],
    test: TestNuisances,
    seen: Mapping[str, bool | None],
) -> Verification:
    """Compare the validation runs; where none is marked those that no fit has seen, or all.

    Channels are put right already; of the ``test`` the moments of time and frequency and the inertia are still to come.
    ``seen`` is what :func:`seen_runs` says of the campaign as it was recorded.
    """
    campaign = as_followed(campaign, model)
    warnings = _compare_joints(model, campaign)
    unseen = tuple(run for run in campaign.runs if seen[run.name] is False)
    runs = campaign.validation_runs or unseen or campaign.runs
    if len(runs) < len(campaign.runs) and not campaign.validation_runs:
        warnings.append(f"compared are the runs that no fit has seen: {', '.join(run.name for run in runs)}")
    warnings += seen_words({run.name: seen[run.name] for run in runs})
    drawn, free_run = settings.drawn(model), settings.free_run
    results: list[RunVerification] = []
    beyond: list[str] = []
    if free_run is not None:
        warnings.append(
            f"each run is simulated without restart, its initial state estimated on the first {free_run} samples, "
            "which are not compared"
        )
    for states in compared_states(campaign, runs, test.timed):
        run = next(each for each in runs if each.name == states.run)
        say(f"simulating runs: {len(results) + 1} of {len(runs)}")
        exceeded = beyond_tested(model, states)
        warnings += exceeded
        beyond += [run.name] * bool(exceeded)

        def simulate(
            other: JointModel, band: bool = False, run: Run = run, states: ForceStates = states
        ) -> SimulatedRun:
            return compare_run(
                lambda known: law_of_test(test, other, known), run, states, settings.window, free_run, band
            )

        simulated = simulate(model)
        if free_run is not None and simulated.drive == "motion":
            why = "its motion was its drive, or the joint has no inertia: the moment of the measured motion is compared"
            warnings.append(f"{run.name}: {in_words_of(campaign.joint.motion, why)}")
        others = [] if simulated.simulated_response is None else drawn
        band = band_of([simulate(other, band=True).simulated_response for other in others])
        results.append(replace(_compare_run(simulated, campaign, run, band), seen=seen[run.name]))
    result = judged(model, "campaign", campaign.joint.name, settings.tolerance, results, warnings)
    return replace(result, free_run=free_run, beyond_range=tuple(beyond))


def seen_runs(model: JointModel, campaign: Campaign) -> dict[str, bool | None]:
    """Return of each run whether a fit of a model has used it; None where the model has no record of that."""
    return {run.name: has_seen(model.fitted, run_hash(run)) for run in campaign.runs}


def beyond_tested(model: JointModel, *states: ForceStates, whose: str = "") -> tuple[str, ...]:
    """Return what to say of runs that go beyond what a model was tested to, each begun with ``whose`` model it is."""
    return tuple(
        line
        for each in states
        for line in range_warnings(
            model.fitted,
            model.joint.motion,
            each.angle,
            each.rate,
            f"{whose}{each.run}",
            each.method != "path",
        )
    )


GIVEN = "the given model in "


def _compare_joints(model: JointModel, campaign: Campaign) -> list[str]:
    motion, declared = campaign.joint.motion, campaign.joint.inertia
    if model.joint.motion != motion:
        raise InputError(
            f"the model is of a joint in {model.joint.motion}, the campaign of one in {motion}; expected a model of "
            "the same motion"
        )
    mean = in_words_of(motion, "the mean angle was not measured where the model was fitted")
    inertia = in_words_of(motion, "the campaign declares the inertia")
    other = declared is not None and not np.isclose(declared, model.inertia, rtol=RESPONSE.accuracy)
    notes = [
        (
            model.joint.name != campaign.joint.name,
            f"the model is of the joint {model.joint.name!r}, the campaign of {campaign.joint.name!r}",
        ),
        (
            not model.fitted.mean_known and campaign.mean_known,
            f"{mean}: its zero is where the elastic moment was zero, that of the campaign may be another",
        ),
        (other, f"{inertia} {declared or 0:g}, the model has {model.inertia:g}"),
    ]
    return [*campaign.warnings, *(words for there, words in notes if there)]


def _compare_run(simulated: SimulatedRun, campaign: Campaign, run: Run, band: Band | None) -> RunVerification:
    q = quantities(campaign.joint.motion)
    rmse_unit, size = _unit_of(run, simulated.channel, q)
    response = simulated.simulated_response
    measured = simulated.measured_response
    along = simulated.states.method == "path"
    first, second = (
        None if along or each is None else oscillation(each, simulated.sample_rate, simulated.frequency)
        for each in (measured, response)
    )
    gap = compare_oscillations(first, second) if _has_cycles(simulated) else None
    return RunVerification(
        name=simulated.run,
        channel=(q.moment if simulated.channel == "moment" else q.angle).lower(),
        drive="path" if along else simulated.drive,
        time=simulated.time,
        measured=measured,
        simulated=response,
        band=band,
        response_nrmse=finite(simulated.response_nrmse),
        moment_nrmse=finite(simulated.moment_nrmse),
        noise_floor=finite(simulated.response_floor),
        amplitude_rms_error=None if gap is None else gap.amplitude_rms_error,
        mean_period_difference=None if gap is None else gap.mean_period_difference,
        oscillations=(first, second),
        energy=cycle_energy(simulated),
        failure=simulated.failure,
        scale=simulated.response_scale,
        moment_scale=simulated.moment_scale,
        rmse=finite(simulated.response_nrmse * simulated.response_scale / size),
        rmse_unit=rmse_unit,
    )


def _unit_of(run: Run, channel: str, q: Quantities) -> tuple[str, float]:
    """Return the unit in which a channel stands in its file, and what one of it is in SI."""
    units = () if run.source is None else run.source.units
    known = {each.channel: (each.unit, abs(each.factor)) for each in units}
    return known.get(channel, (q.moment_unit if channel == "moment" else q.angle_unit, 1.0))


def _has_cycles(simulated: SimulatedRun) -> bool:
    """Whether amplitude and period mean something: the run repeats, or the joint vibrates freely most of the time.

    A multiple-shooting segment starts from the measured state: its amplitudes would flatter the model.
    """
    if simulated.drive not in ("moment", "free run"):
        return False
    driven = np.abs(simulated.moment) > RESPONSE.minor_share * simulated.moment_scale
    return simulated.states.method == "periodic" or float(np.mean(driven)) < RESPONSE.minor_share


def cycle_energy(simulated: SimulatedRun) -> Array | None:
    """Work done on the joint in each whole period, measured and simulated, J, shape (2, cycles); None without one."""
    if simulated.frequency is None:
        return None
    rate = simulated.states.rate
    if simulated.drive == "motion":
        powers = simulated.moment * rate, simulated.simulated_moment * rate
    elif simulated.simulated_rate is not None:
        powers = simulated.moment * rate, simulated.moment * simulated.simulated_rate
    else:
        return None
    per = simulated.sample_rate / simulated.frequency
    edges = np.round(np.arange(int(simulated.time.size / per + 1e-9) + 1) * per).astype(int)
    if edges.size < 2:
        return None
    sums = [np.add.reduceat(power[: edges[-1]], edges[:-1]) for power in powers]
    return np.array(sums) / simulated.sample_rate
