"""Plan a test before it is made: from a rough idea of the joint, or after some runs."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

from sindyjoint.clock import single_threaded
from sindyjoint.diagnosis.effects import Effect
from sindyjoint.diagnosis.policy import CAMPAIGN
from sindyjoint.equation.catalogue_file import as_model
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, UnknownNameError, checks_options, refuse
from sindyjoint.files.campaign import LONGEST
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.limits import PLANNING
from sindyjoint.mechanics import PaperLaw
from sindyjoint.mechanics.excitation import SINE, TONES, Actuator
from sindyjoint.mechanics.virtual import named_joint
from sindyjoint.numeric import RNG, seed_of
from sindyjoint.planning import PlannedRun
from sindyjoint.planning.information import Sensors
from sindyjoint.planning.plan import TELL_APART, UNITS, Plan, Separation
from sindyjoint.planning.planner import Planner
from sindyjoint.planning.prior import (
    Prior,
    Tested,
    like_law,
    like_model,
    measured_sensors,
    prior_of_runs,
    tested_by,
    tested_of,
)
from sindyjoint.planning.search import DEFAULT_GOALS, GOALS
from sindyjoint.planning.separating_runs import (
    SeparatingRuns,
    chosen_effects,
    rivals_of,
    simulate_hypotheses,
)
from sindyjoint.record import Campaign
from sindyjoint.states import REPLICATES
from sindyjoint.workflows.check import the_campaign
from sindyjoint.workflows.diagnose import diagnose as diagnosed
from sindyjoint.workflows.discover import discover

Say = Callable[[str], None]

LIKE = "inter-panel"
BAND = (2.0, 8.0)  # Hz, where nothing was tested


@checks_options()
@single_threaded()
def plan(
    like: str | None = None,
    *,
    model: JointModel | str | Path | None = None,
    campaign: Campaign | str | Path | Any = None,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    drive: str | None = None,
    band: tuple[float, float] | None = None,
    limits: Mapping[str, float] | None = None,
    noise: float | None = None,
    moment_noise: float | None = None,
    angle_noise: float | None = None,
    sample_rate: float | None = None,
    resolution: Mapping[str, float] | None = None,
    waveforms: Sequence[str] = (SINE,),
    time: float = 90.0,
    run_time: float | None = None,
    goal: str | Mapping[str, float] | None = None,
    effects: Sequence[str] = (),
    diagnosis: str | Path | None = None,
    share: float = 0.06,
    terms: Sequence[str] = (),
    until: float | None = None,
    rng: RNG = 0,
    progress: Say | None = None,
) -> Plan:
    """Plan the runs that are most informative of a joint's coefficients.

    Parameters
    ----------
    like : {"inter-panel", "panel-root"}, optional
        A joint of the paper that the joint resembles: each coefficient within 20 % of its own. Default: the first,
        where neither a model nor a campaign says more.
    model : JointModel or path, optional
        A model of the joint instead: each coefficient within three standard errors. Its elements with a memory are in
        every simulation, with the numbers that they have.
    campaign : Campaign or path, optional
        Runs that were made: a model is discovered from them, and their information is added. The terms of ``like`` or
        ``model``, where one is given, are then kept in that model, and their ranges hold as well.
    ranges : mapping of str to (float, float), optional
        Of coefficients by term, SI, instead of these.
    drive : {"moment", "angle"}, optional
        What the actuator prescribes. Default: the moment; the angle where the joint's inertia is not known.
    band : (float, float), optional
        Hz. Default: what the campaign, or the model's, has tested; 2 to 8 Hz where nothing was tested.
    limits : mapping of str to float, optional
        Largest ``"moment"`` (N·m), ``"angle"`` (rad) and ``"rate"`` (rad/s) of the actuator, instead of those that the
        campaign declares. Without any no run leaves the moment, angle and rate that were tested; a limit beyond that
        lets all three go, and a warning says by how much the plan leaves them.
    noise : float, optional
        RMS of a sample as a share of each channel's RMS, for a channel whose own is not given. Default: as measured in
        the campaign, or 0.01.
    moment_noise, angle_noise : float, optional
        RMS of a sample, N·m and rad.
    sample_rate : float, optional
        Hz. Default: that of the campaign, or 1000.
    resolution : mapping of str to float, optional
        Steps in which ``"moment"`` (N·m) and ``"angle"`` (rad) are read.
    waveforms : sequence of str
        Among which is chosen: ``"sine"``, ``"two-tone-3"`` (a second tone of three times the frequency and 0.8 of the
        amplitude), ``"two-tone-5"`` (five times, 0.5), ``"triangle"`` (five odd harmonics), ``"multisine"`` (five equal
        tones), ``"sweep"`` (a sine from the frequency at which it repeats to five times that, and back).
    time : float
        Duration of all runs that are still to be made, s.
    run_time : float, optional
        Duration of each, s. Default: an 18th of the time, or what eight periods of the lowest frequency take; where
        nothing but telling effects apart is the goal, half of the time.
    goal : {"widths", "frequency", "paper", "tell-apart"} or mapping of these to weights
        Make the widest relative interval small; or the widest relative change over the band that could be overlooked;
        or decide which terms the joint has: what the weakest term lacks of being taken by a discovery; or tell effects
        apart, by the search of the advice of :func:`~sindyjoint.diagnose`.
    effects : sequence of str
        That are to be told apart.
    diagnosis : path, optional
        ``diagnosis.json``, or a folder with one: the effects that it could not tell apart.
    share : float
        Of the moment's RMS that an effect adds, where no campaign shows how large it is.
    terms : sequence of str
        Coefficients that matter. Default: all.
    until : float, optional
        Relative half-width that is enough: the plan ends where 95 of 100 tests reach it, and is empty once the runs of
        a campaign have.
    rng : int, Generator or None
        Of the joints that are drawn from the range.
    progress : callable, optional
        Called with the name of each stage.

    Returns
    -------
    Plan

    Raises
    ------
    InputError, UnknownNameError
        For options that cannot be used, and limits that no run keeps.

    Examples
    --------
    >>> import sindyjoint
    >>> made = sindyjoint.plan("inter-panel", time=6.0, band=(2.0, 4.0))
    >>> made.seconds <= 6.0, len(made.runs)
    (True, 1)
    """
    say = progress or (lambda stage: None)
    both, bounded = model is not None and like is not None, until is None or 0 < until <= 1
    refuse(
        [
            (both, "a model and a joint that it is like were given; expected one of them"),
            (not 0 < share < 1, f"share is {share!r}; expected a share of the moment between 0 and 1"),
            (not bounded, f"until is {until!r}; expected a positive share, at most 1"),
            (
                not waveforms or not {*waveforms} <= TONES.keys(),
                f"waveforms are {', '.join(waveforms) or 'none'}; expected some of {', '.join(TONES)}",
            ),
        ]
    )
    known_model = None if model is None else as_model(model)
    seed = seed_of(rng)
    campaign = None if campaign is None else the_campaign(campaign, seed, LONGEST)
    tested = None if known_model is None else tested_of(known_model)
    tested = tested if campaign is None else tested_by(campaign)
    declared = {} if campaign is None else campaign.limits
    actuator = _actuator(tested, drive or "moment", band, {**declared, **(limits or {})})
    goals = _goals(DEFAULT_GOALS if goal is None else goal)
    rivals = _rivals(goals, effects, diagnosis)
    duration, count = _durations(actuator, time, run_time)
    given = {"sample_rate": sample_rate, "noise": noise, "moment": moment_noise, "angle": angle_noise}
    stated = {name: value for name, value in given.items() if value is not None}
    stated |= _resolutions(resolution or {})
    Sensors(**stated)  # refused before anything is worked on
    separating = SeparatingRuns(rivals, actuator, duration, diagnosed, say)
    if rivals and campaign is not None:
        # Beside no other goal its runs, two at most, have all of the time.
        longer = duration if len(goals) > 1 or run_time is not None else time / CAMPAIGN.most_runs
        with_time = replace(separating, actuator=replace(actuator, duration=longer), duration=longer)
        runs, apart, model = with_time.after_runs(campaign, known_model)
        if len(goals) == 1:
            return _only_separation(runs, apart, model, actuator, Sensors(**stated))
    known, sensors = _make_prior(like, known_model, campaign, ranges or {}, seed, say)
    known = replace(known, tested=tested)
    if drive is None and known.joint.model.inertia <= 0:
        # No run under a moment can be simulated without it.
        actuator = replace(actuator, drive="angle")
    if "noise" in stated:  # a share that is given holds for both channels
        sensors = replace(sensors, moment=None, angle=None)
    sensors = replace(sensors, **stated)
    unit = UNITS[actuator.drive][known.joint.model.joint.motion != "rotation"]
    matter = _places(known.joint.model, terms or known.ids)
    weights = tuple(each for each in goals.items() if each[0] != TELL_APART) or tuple(
        _goals(DEFAULT_GOALS).items()
    )
    made = Planner(known, actuator, sensors, matter, weights, until, seed, say, tuple(waveforms))
    if not rivals:
        return made.plan(unit, duration, count)
    if campaign is not None:
        plain = made.plan(unit, duration, max(count - len(runs), 1))
        return _with_separation(plain, runs, apart)
    if count < 2:
        raise InputError(f"time is {time:g} s; expected two runs at least, one of them to tell effects apart")
    plain = made.plan(unit, duration, count - 1)
    joints = known.joint.draws(len(rivals), seed)
    hypotheses = simulate_hypotheses(joints, rivals, plain.runs, sensors, share, seed)
    return _with_separation(plain, *separating.before_runs(hypotheses))


def _rivals(
    goals: Mapping[str, float], effects: Sequence[str], diagnosis: str | Path | None
) -> tuple[Effect, ...]:
    """Return the effects that are to be told apart; none where that is no goal."""
    if TELL_APART in goals:
        return chosen_effects(rivals_of(diagnosis) if diagnosis is not None and not effects else effects)
    if effects or diagnosis is not None:
        raise InputError(
            "effects were given, but the goal is not to tell them apart; expected goal 'tell-apart'"
        )
    return ()


def _goals(goal: str | Mapping[str, float]) -> dict[str, float]:
    """Return goals with their weights, which add up to one, the weightiest first."""
    given = {goal: 1.0} if isinstance(goal, str) else dict(goal)
    known = f"expected {', '.join(map(repr, GOALS))} or {TELL_APART!r}"
    refuse(
        [
            (not given, "no goal was given; expected one at least"),
            *((name not in (*GOALS, TELL_APART), f"goal is {name!r}; {known}") for name in given),
            *(
                (not 0 < weight < inf, f"weight of goal {name!r} is {weight!r}; expected a positive number")
                for name, weight in given.items()
            ),
        ]
    )
    total = sum(given.values())
    return {name: given[name] / total for name in sorted(given, key=lambda name: -given[name])}


def _only_separation(
    runs: tuple[PlannedRun, ...], apart: Separation, model: JointModel, actuator: Actuator, sensors: Sensors
) -> Plan:
    """Return the plan of runs that tell effects apart, beside a campaign that was made."""
    return Plan(
        model, tuple(model.coefficients), tuple(model.coefficients), actuator, sensors, ((TELL_APART, 1.0),), (),
        runs, (), (), (), (), None, apart.words, apart=apart,
    )  # fmt: skip


def _with_separation(plan: Plan, runs: Sequence[PlannedRun], apart: Separation) -> Plan:
    """Return a plan with the runs that tell effects apart behind its own."""
    return replace(plan, runs=(*plan.runs, *runs), apart=apart, stop=f"{plan.stop}; {apart.words}")


def _actuator(
    tested: Tested | None, drive: str, band: tuple[float, float] | None, limits: Mapping[str, float]
) -> Actuator:
    _check_known(limits, ("moment", "angle", "rate"), "limit of {!r}; expected moment, angle or rate")
    Actuator(drive, band or BAND, **limits)  # type: ignore[arg-type]  # refused as it was given
    return (tested or Tested({}, BAND)).actuator(drive, band, limits)  # type: ignore[arg-type]


def _check_known(given: Iterable[str], known: Collection[str], said: str) -> None:
    for name in sorted({*given} - {*known}):
        raise UnknownNameError(said.format(name))


def _resolutions(resolution: Mapping[str, float]) -> dict[str, float]:
    """Return the steps of the sensors by their names there."""
    _check_known(resolution, ("moment", "angle"), "resolution of {!r}; expected moment or angle")
    return {f"{name}_resolution": step for name, step in resolution.items()}


def _places(model: JointModel, terms: Sequence[str]) -> tuple[int, ...]:
    _check_known(terms, model.ids, f"term {{!r}}; the joint has {', '.join(model.ids)}")
    return tuple(model.ids.index(term) for term in terms)


def _durations(actuator: Actuator, time: float, run_time: float | None) -> tuple[float, int]:
    """Return the duration of each run, and their number."""
    shortest = (REPLICATES + 1) / actuator.band[0]
    if run_time is not None and not shortest <= run_time <= time:
        raise InputError(
            f"run_time is {run_time:g} s; expected between {shortest:.3g} s, {REPLICATES} steady periods of "
            f"{actuator.band[0]:g} Hz, and the {time:g} s of all runs"
        )
    count = 0
    if 0 < time < inf:
        # Twice as many as the plain grid has: the shorter each is, the less the fewest settings take of the time.
        most = 2 * PLANNING.fewest * len(PLANNING.levels[::2])
        count = min(most, int(time / shortest)) if run_time is None else int(time / run_time + 1e-9)
    refuse(
        [
            (
                not count,
                f"time is {time:g} s; expected at least {shortest:.3g} s, a run of {REPLICATES} steady periods "
                f"of {actuator.band[0]:g} Hz",
            ),
            (
                count > PLANNING.most_runs,
                f"{count} runs of {run_time or 0.0:g} s in {time:g} s; expected at most {PLANNING.most_runs}",
            ),
        ]
    )
    return run_time or time / count, count


def _make_prior(
    like: str | None,
    model: JointModel | None,
    campaign: Campaign | None,
    ranges: Mapping[str, tuple[float, float]],
    seed: int,
    say: Say,
) -> tuple[Prior, Sensors]:
    """Return what is known of the joint, and the sensors as the campaign has shown them."""
    before = None
    if model is not None:
        # Runs are planned of angle and rate: inputs are held at their reference.
        before = like_model(as_model(model).at())
    elif like is not None or campaign is None:
        law = named_joint(like or LIKE)
        assert isinstance(law, PaperLaw)
        before = like_law(law)
    if before is not None:
        before = before.narrowed(ranges)
    if campaign is None:
        assert before is not None
        return Prior(before), Sensors()
    found, made = _discovered(campaign, () if before is None else before.model.ids, seed, say)
    known = prior_of_runs(found.model, found.regressor.evidence_, found.states, made, before)
    if before is None:
        known = replace(known, joint=known.joint.narrowed(ranges))
    return known, measured_sensors(found.states)


def _discovered(campaign: Campaign, forced: Sequence[str], seed: int, say: Say) -> tuple[Discovery, float]:
    """Return what was discovered, the terms that the joint was said to have among it, and the time of the runs."""
    found = discover(campaign, forced=forced, rng=seed, progress=say)
    used = ", ".join(each.name for each in found.model.used_inputs)
    refuse(
        [
            (
                not found.found,
                f"no model was discovered from the campaign: {found.reason}; plan without it",
            ),
            (
                used,
                f"the law of the campaign depends on {used}, which a plan does not choose; discover it with --out, and "
                f"plan with --model of that folder: at the reference of {used}",
            ),
        ]
    )
    return found, sum(run.duration for run in (found.measured or found.campaign).identification_runs)
