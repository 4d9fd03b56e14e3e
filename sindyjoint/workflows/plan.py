"""Plan a test before it is made: from a rough idea of the joint, or after some runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sindyjoint.discovery.evidence import Evidence, block_scores
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.model_file import read_model
from sindyjoint.errors import InputError, UnknownNameError
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.mechanics.laws import PaperLaw
from sindyjoint.mechanics.virtual import named_joint
from sindyjoint.options import checks_options
from sindyjoint.planning.information import Information, Sensors, chosen_terms, run_information, stacked
from sindyjoint.planning.joints import JointRange, like_law, like_model
from sindyjoint.planning.plan import Plan, Prediction, Step, predictions, widest_of
from sindyjoint.planning.policy import POLICY
from sindyjoint.planning.runs import Actuator, PlannedRun, candidates
from sindyjoint.planning.search import Choice, Goal, best_runs
from sindyjoint.record import Campaign
from sindyjoint.response.model_law import model_law
from sindyjoint.text import percent, spelled
from sindyjoint.threads import single_threaded

Array = NDArray[np.float64]
Say = Callable[[str], None]

# Joints on which the chosen runs, and the grid, are predicted.
PREDICTED = 40


@dataclass(frozen=True, eq=False)
class _Known:
    """What is known before the plan: the joint's range, and the runs that were made."""

    joint: JointRange
    information: Information | None = None
    runs: tuple[tuple[float, str], ...] = ()
    model: JointModel | None = None  # of the campaign, with the intervals that it has reached

    def expanded(self, joints: int) -> Information | None:
        """Return the information of the made runs for as many joints."""
        if self.information is None:
            return None
        held = self.information
        names = ("bread", "meat", "pull", "blocks")
        return Information(
            *(
                np.repeat(np.asarray(getattr(held, name))[:, None], joints, axis=1).astype(float)
                for name in names
            )
        )


@checks_options()
@single_threaded()
def plan(
    like: str = "inter-panel",
    *,
    model: JointModel | str | Path | None = None,
    campaign: Campaign | str | Path | None = None,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    drive: str = "moment",
    band: tuple[float, float] = (2.0, 8.0),
    limits: Mapping[str, float] | None = None,
    noise: float = 0.01,
    moment_noise: float | None = None,
    angle_noise: float | None = None,
    sample_rate: float = 1000.0,
    time: float = 90.0,
    goal: Goal = "widths",
    terms: Sequence[str] = (),
    until: float | None = None,
    random_state: int = 0,
    progress: Say | None = None,
) -> Plan:
    """Plan the runs that tell most of a joint's coefficients.

    Parameters
    ----------
    like : {"inter-panel", "panel-root"}
        A joint of the paper that the joint resembles: each coefficient within 20 % of its own.
    model : JointModel or path, optional
        A model of the joint instead: each coefficient within three standard errors.
    campaign : Campaign or path, optional
        Runs that were made: the model is discovered from them, and what they tell is added.
    ranges : mapping of str to (float, float), optional
        Of coefficients by term, SI, instead of these.
    drive : {"moment", "angle"}
        What the actuator prescribes.
    band : (float, float)
        Hz.
    limits : mapping of str to float, optional
        Largest ``"moment"`` (N·m), ``"angle"`` (rad) and ``"rate"`` (rad/s) of the actuator.
    noise : float
        RMS of a sample as a share of each channel's RMS, for a channel whose own is not given.
    moment_noise, angle_noise : float, optional
        RMS of a sample, N·m and rad.
    sample_rate : float
        Hz.
    time : float
        Duration of all runs together, s.
    goal : {"widths", "frequency"}
        Make the widest relative interval small, or the widest relative change over the band that could be overlooked.
    terms : sequence of str
        Coefficients that matter. Default: all.
    until : float, optional
        Relative half-width that is enough: the plan ends where 95 of 100 tests reach it.
    random_state : int
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
    >>> found = plan(ranges={"linear_stiffness": (5000.0, 8000.0)}, time=60.0)  # doctest: +SKIP
    >>> found.report("plan")  # doctest: +SKIP
    """
    say = progress or (lambda stage: None)
    actuator = _actuator(drive, band, limits or {})
    sensors = Sensors(sample_rate, noise, moment_noise, angle_noise)
    if goal not in ("widths", "frequency"):
        raise InputError(f"goal is {goal!r}; expected 'widths' or 'frequency'")
    if until is not None and not 0 < until < inf:
        raise InputError(f"until is {until!r}; expected a positive share")
    known = _what_is_known(like, model, campaign, say)
    known = replace(known, joint=known.joint.narrowed(ranges or {}))
    motion = known.joint.model.joint.motion
    unit = {"moment": "N*m", "angle": "rad"} if motion == "rotation" else {"moment": "N", "angle": "m"}
    matter = _places(known.joint.model, terms)
    duration, count = _durations(actuator, time)
    made = _Making(known, actuator, sensors, matter, goal, until, random_state, say)
    return made.plan(unit[actuator.drive], duration, count)


@dataclass(frozen=True, eq=False)
class _Making:
    """The making of a plan."""

    known: _Known
    actuator: Actuator
    sensors: Sensors
    matter: tuple[int, ...]
    goal: Goal
    until: float | None
    random_state: int
    say: Say

    def plan(self, unit: str, duration: float, count: int) -> Plan:
        """Return the plan of ``count`` runs."""
        joint = self.known.joint
        drawn = joint.draws(POLICY.joints, self.random_state)
        laws = [model_law(one) for one in (*joint.corners(), *drawn)]
        middle = model_law(joint.model)
        offered, grid = candidates(laws, middle, self.actuator, duration, unit, say=self.say)
        choice = self._choice(offered, drawn)
        self.say("choosing runs")
        chosen = [] if self._reached() else best_runs(choice, count)
        runs = tuple(offered[i] for i in chosen)
        # The grid lasts as long, whatever number of runs the plan has.
        grid = tuple(replace(run, duration=duration * count / len(grid)) for run in grid)
        return self._predicted(runs, grid, [choice.missing(chosen[:k]) for k in range(1, len(chosen) + 1)])

    def _choice(self, offered: Sequence[PlannedRun], drawn: Sequence[JointModel]) -> Choice:
        information = self._information(offered, drawn, "what each run would tell")
        return Choice(
            tuple(offered), information, np.array([one.coefficients for one in drawn]), self.matter, self.goal,
            self.known.expanded(len(drawn)), self.known.runs,
        )  # fmt: skip

    def _information(
        self, runs: Sequence[PlannedRun], joints: Sequence[JointModel], stage: str
    ) -> Information:
        parts: dict[PlannedRun, Information] = {}
        for run in runs:
            if run not in parts:
                self.say(f"{stage}: {len(parts) + 1} of {len(set(runs))}")
                parts[run] = stacked([run_information(run, one, self.sensors) for one in joints])
        return stacked([parts[run] for run in runs])

    def _reached(self) -> bool:
        """Return whether the intervals of the runs that were made are narrow enough."""
        return self.until is not None and self._widest_now() <= self.until

    def _widest_now(self) -> float:
        model = self.known.model
        if model is None or self.goal != "widths":
            return inf
        half = [(term.interval95[1] - term.interval95[0]) / 2 / abs(term.coefficient) for term in model.terms]
        return max(half[i] for i in self.matter)

    def _predicted(
        self, runs: tuple[PlannedRun, ...], grid: tuple[PlannedRun, ...], missing: Sequence[int]
    ) -> Plan:
        """Return the plan of these runs, ended where they are enough, with what they and the grid would tell."""
        joint, known = self.known.joint, self.known.expanded(PREDICTED)
        joints = joint.draws(PREDICTED, self.random_state + 1)
        coefficients = np.array([one.coefficients for one in joints])
        told = known
        if runs:
            told = self._information(runs, joints, "what the plan tells").with_runs(known)
        assert told is not None  # without runs there is a campaign
        grid, grid_told = self._of_grid(grid, joints, known)
        curve = self._curve((runs, told), (grid, grid_told), coefficients)
        enough = len(runs)
        if self.until is not None:
            # Not before there are runs enough at different frequencies and levels.
            reached = (
                step.runs
                for step, lack in zip(curve, missing, strict=True)
                if not lack and step.highest <= self.until
            )
            enough = next(reached, len(runs))
        if enough < len(runs):
            told = told.take(range(len(self.known.runs) + enough))
            shorter = tuple(replace(run, duration=run.duration * enough / len(runs)) for run in grid)
            grid, grid_told = self._of_grid(shorter, joints, known)
        found = predictions(joint.model, told, coefficients)
        return Plan(
            joint.model, tuple(joint.low), tuple(joint.high), self.actuator, self.sensors, self.goal,
            tuple(joint.model.ids[i] for i in self.matter), runs[:enough], found,
            () if grid_told is None else predictions(joint.model, grid_told, coefficients), grid, curve, self.until,
            self._advice(curve, enough), _warnings(found, grid, joint.model.joint.motion),
        )  # fmt: skip

    def _of_grid(
        self, grid: tuple[PlannedRun, ...], joints: Sequence[JointModel], known: Information | None
    ) -> tuple[tuple[PlannedRun, ...], Information | None]:
        """Return the grid and what it would tell; nothing of a grid whose runs are too short."""
        try:
            return grid, self._information(grid, joints, "the grid of the same duration").with_runs(known)
        except InputError:
            return (), None

    def _curve(
        self,
        plan: tuple[tuple[PlannedRun, ...], Information],
        grid: tuple[tuple[PlannedRun, ...], Information | None],
        coefficients: Array,
    ) -> tuple[Step, ...]:
        """Return what is known after each run."""
        made = [frequency for frequency, _ in self.known.runs]

        def widest(
            planned: tuple[PlannedRun, ...], told: Information | None, count: int
        ) -> tuple[float, float]:
            if told is None or count > len(planned):
                return inf, inf
            at = [*made, *(run.frequency for run in planned[:count])]
            part = told.take(range(len(at)))
            return widest_of(part, coefficients, self.matter, at if self.goal == "frequency" else None)

        steps = []
        for k in range(1, len(plan[0]) + 1):
            taken = chosen_terms(plan[1].take(range(len(made) + k)), coefficients)[:, list(self.matter)]
            complete = float(taken.all(axis=1).mean())
            steps.append(Step(k, k * plan[0][0].duration, *widest(*plan, k), complete, widest(*grid, k)[0]))
        return tuple(steps)

    def _advice(self, curve: Sequence[Step], enough: int) -> str:
        """Return when to stop, in words."""
        if self.until is None:
            return "all of the time is used: no half-width was given that is enough"
        what = "half-width" if self.goal == "widths" else "change over the band"
        if not curve:
            now = percent(self._widest_now())
            return f"stop: the widest relative {what} is {now}, and {percent(self.until)} is enough"
        if curve[enough - 1].highest <= self.until:
            return (
                f"after {enough} runs: 95 of 100 tests then reach a relative {what} of {percent(self.until)}"
            )
        return (
            f"not within this time: after {enough} runs 95 of 100 tests reach {percent(curve[-1].highest)}, "
            f"not {percent(self.until)}"
        )


def _warnings(found: Sequence[Prediction], grid: Sequence[PlannedRun], motion: str) -> tuple[str, ...]:
    warnings = [
        f"a discovery would leave {spelled(each.id, motion)} out of {percent(1 - each.chosen)} of the joints of the "
        "range: it carries too little of the moment there"
        for each in found
        if each.chosen <= 0.975
    ]
    if not grid:
        warnings.append("the time is too short for a grid of three frequencies and three levels")
    return tuple(warnings)


def _actuator(drive: str, band: tuple[float, float], limits: Mapping[str, float]) -> Actuator:
    unknown = set(limits) - {"moment", "angle", "rate"}
    if unknown:
        raise UnknownNameError(f"limit of {sorted(unknown)[0]!r}; expected moment, angle or rate")
    return Actuator(drive, band, **limits)  # type: ignore[arg-type]


def _places(model: JointModel, terms: Sequence[str]) -> tuple[int, ...]:
    for term in terms:
        if term not in model.ids:
            raise UnknownNameError(f"term {term!r}; the joint has {', '.join(model.ids)}")
    return tuple(model.ids.index(term) for term in terms or model.ids)


def _durations(actuator: Actuator, time: float) -> tuple[float, int]:
    """Return the duration of each run, and their number."""
    shortest = (POLICY.fewest_periods + 1) / actuator.band[0]
    count = min(POLICY.setups, int(time / shortest)) if 0 < time < inf else 0
    if not count:
        raise InputError(
            f"time is {time:g} s; expected at least {shortest:.3g} s, a run of {POLICY.fewest_periods} steady periods "
            f"of {actuator.band[0]:g} Hz"
        )
    return time / count, count


def _what_is_known(
    like: str, model: JointModel | str | Path | None, campaign: Campaign | str | Path | None, say: Say
) -> _Known:
    if model is not None and campaign is not None:
        raise InputError("a model and a campaign were given; expected one of them")
    if campaign is not None:
        from sindyjoint.workflows.discover import discover

        return _known_of(discover(campaign, progress=say))
    if model is not None:
        return _Known(like_model(model if isinstance(model, JointModel) else read_model(model)))
    law = named_joint(like)
    assert isinstance(law, PaperLaw)
    return _Known(like_law(law))


def _known_of(found: Discovery) -> _Known:
    """Return what the runs of a campaign tell of the terms that were discovered from them."""
    if not found.found:
        raise InputError(f"no model was discovered from the campaign: {found.reason}; plan with ranges")
    joint, evidence = like_model(found.model), found.regressor.evidence_
    lacking = [spelled(name) for name in found.model.ids if name not in evidence.ids]
    if lacking:
        raise InputError(f"{', '.join(lacking)}: fixed in the fit of the campaign; plan with ranges")
    columns = [evidence.ids.index(name) for name in found.model.ids]
    coefficients = np.array([found.model[name].coefficient for name in found.model.ids])
    parts, size = [], len(columns)
    for run in evidence.take(columns).runs:
        scores, _ = block_scores(Evidence(found.model.ids, (run,)), range(size), coefficients)
        triangle = run.pooled.triangle[:, :-1]
        parts.append(
            Information(
                triangle.T @ triangle, scores.T @ scores, np.zeros(size), np.array(float(len(run.blocks)))
            )
        )
    largest = max(float(np.ptp(state.angle)) for state in found.states)
    runs = []
    for state in found.states:
        share = float(np.ptp(state.angle)) / largest
        runs.append((state.frequency or 0.0, str(int(np.argmin(np.abs(np.array(POLICY.levels) - share))))))
    return _Known(joint, stacked(parts), tuple(runs), found.model)
