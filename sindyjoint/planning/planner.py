"""Planning: which runs could be made, how informative each would be, which are chosen, and what they give."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.limits import PLANNING
from sindyjoint.mechanics.excitation import SINE, Actuator, driven_at
from sindyjoint.numeric import Array
from sindyjoint.planning import PlannedRun, candidates, counted_runs, motion
from sindyjoint.planning.information import (
    Information,
    Sensors,
    chosen_terms,
    half_widths,
    run_information,
    stacked,
)
from sindyjoint.planning.plan import UNITS, Now, Plan, Prediction, Step
from sindyjoint.planning.prior import Prior
from sindyjoint.planning.search import FREQUENCY, PAPER, WIDTHS, Choice, Goals, best_runs, made_small
from sindyjoint.response.laws import model_law
from sindyjoint.text import list_some, percent, spelled

Say = Callable[[str], None]

# Joints on which the chosen runs, and the grid, are predicted, and what the scatter of a test makes of an interval on
# each, so many times; the 90 % band of 40 held 88.7 % of those of others.
DRAWS = 40
WORDS = {
    WIDTHS: "widest relative half-width",
    FREQUENCY: "widest relative change over the band",
    PAPER: "requirement of the weakest term",
}


@dataclass(frozen=True, eq=False)
class Planner:
    """Makes a plan from what is known, what the actuator can do and what is asked."""

    known: Prior
    actuator: Actuator
    sensors: Sensors
    matter: tuple[int, ...]
    goals: Goals
    until: float | None
    random_state: int
    say: Say
    waveforms: tuple[str, ...] = (SINE,)

    @property
    def _goal(self) -> str:
        return self.goals[0][0]

    def plan(self, unit: str, duration: float, count: int) -> Plan:
        """Return the plan of ``count`` runs."""
        joint = self.known.joint
        drawn = joint.draws(PLANNING.joints, self.random_state)
        laws = [model_law(one) for one in (*joint.corners(), *drawn)]
        middle = model_law(joint.model)
        offered, grid = candidates(
            laws, middle, self.actuator, duration, unit, waveforms=self.waveforms, say=self.say
        )
        choice = self._choice(offered, grid, drawn)
        self.say("choosing runs")
        now = self._now(choice)
        chosen = [] if now is not None and now.reached else best_runs(choice, count, self.until)
        runs = tuple(offered[i] for i in chosen)
        # The grid lasts as long, whatever number of runs the plan has.
        grid = tuple(replace(run, duration=duration * len(chosen) / len(grid)) for run in grid)
        missing = [choice.missing(chosen[:k]) for k in range(1, len(chosen) + 1)]
        return self._predicted(runs, grid, missing, now)

    def _choice(
        self, offered: Sequence[PlannedRun], grid: Sequence[PlannedRun], drawn: Sequence[JointModel]
    ) -> Choice:
        every = tuple(dict.fromkeys((*offered, *grid)))
        information = self._information(every, drawn, "what each run would tell")
        of = {run: place for place, run in enumerate(every)}
        return Choice(
            tuple(offered), information.take([of[run] for run in offered]),
            np.array([one.coefficients for one in drawn]), self.matter, self.goals,
            self.known.expanded(len(drawn)), self._levels_made(offered),
            information.take([of[run] for run in grid]),
        )  # fmt: skip

    def _levels_made(self, offered: Sequence[PlannedRun]) -> tuple[tuple[float, str], ...]:
        """Return frequency and level of each run that was made: which of the offered levels moves the joint so far."""
        law, made = model_law(self.known.joint.model), []
        for frequency, swing in self.known.runs:
            near = min((run.frequency for run in offered), key=lambda f: abs(f - frequency))
            top = max((run for run in offered if run.frequency == near), key=lambda run: run.level)
            share = swing / (np.ptp(motion(law, top.drive, near, top.level, waveform=top.waveform).angle) / 2)
            made.append((frequency, str(int(np.argmin(np.abs(np.array(PLANNING.levels) - share))))))
        return tuple(made)

    def _information(
        self, runs: Sequence[PlannedRun], joints: Sequence[JointModel], stage: str
    ) -> Information:
        parts: dict[PlannedRun, Information] = {}
        for number, run in enumerate(dict.fromkeys(runs), 1):
            self.say(f"{stage}: {number} of {len(set(runs))}")
            parts[run] = stacked([run_information(run, one, self.sensors) for one in joints])
        return stacked([parts[run] for run in runs])

    def _now(self, choice: Choice) -> Now | None:
        """Return how far the runs that were made have come, and whether that is enough."""
        known = self.known
        if choice.known is None:
            return None
        widest = float(choice.widest([]).max())
        if self._goal == WIDTHS:
            half = known.half_widths()
            widest = float(max(half[i] / abs(known.joint.model.coefficients[i]) for i in self.matter))
        complete, missing = 1.0 - choice.left_out([]), choice.missing([])
        enough = self.until is not None and widest <= self.until
        reached = bool(enough and not missing and complete >= PLANNING.confident)
        return Now(len(known.runs), known.seconds, widest, complete, missing, reached)

    def _predicted(
        self,
        runs: tuple[PlannedRun, ...],
        grid: tuple[PlannedRun, ...],
        missing: Sequence[int],
        now: Now | None,
    ) -> Plan:
        """Return the plan of these runs, ended where they are enough, with the precision expected of both."""
        joint, known = self.known.joint, self.known.expanded(DRAWS)
        joints = joint.draws(DRAWS, self.random_state + 1)
        coefficients = np.array([one.coefficients for one in joints])
        told = self._information(runs, joints, "what the plan tells").with_runs(known) if runs else None
        information = told or known
        assert information is not None  # without runs there is a campaign
        grid, of_grid = self._of_grid(grid, joints, known)
        curve = self._curve((runs, information), (grid, of_grid), coefficients)
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
            information = information.take(range(len(self.known.runs) + enough))
            shorter = tuple(replace(run, duration=run.duration * enough / len(runs)) for run in grid)
            grid, of_grid = self._of_grid(shorter, joints, known)
        found = predictions(joint.model, information, coefficients)
        return Plan(
            joint.model, tuple(joint.low), tuple(joint.high), self.actuator, self.sensors, self.goals,
            tuple(joint.model.ids[i] for i in self.matter), runs[:enough], found,
            () if of_grid is None else predictions(joint.model, of_grid, coefficients), grid, curve, self.until,
            self._advice(curve, enough, now),
            (
                *self.known.notes,
                *_warnings(found, bool(grid) or now is not None, joint.model),
                *_beyond_tested(self.known, runs[:enough]),
            ), now,
        )  # fmt: skip

    def _of_grid(
        self, grid: tuple[PlannedRun, ...], joints: Sequence[JointModel], known: Information | None
    ) -> tuple[tuple[PlannedRun, ...], Information | None]:
        """Return the grid and its information; nothing of a grid whose runs are too short."""
        if not grid:
            return (), None
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
            planned: tuple[PlannedRun, ...], information: Information | None, count: int
        ) -> tuple[float, float]:
            if information is None or not 0 < count <= len(planned):
                return inf, inf
            at = [*made, *(run.frequency for run in planned[:count])]
            part = information.take(range(len(at)))
            noise = np.random.default_rng(0)
            values = made_small(self._goal, part, coefficients, self.matter, at, noise, DRAWS)
            median, highest = np.quantile(values, (0.5, 0.95), method="nearest")
            return float(median), float(highest)

        steps = []
        for k in range(1, len(plan[0]) + 1):
            taken = chosen_terms(plan[1].take(range(len(made) + k)), coefficients)[:, list(self.matter)]
            complete = float(taken.all(axis=1).mean())
            seconds = k * plan[0][0].duration
            # Of the grid, whose runs may be longer, as many as are made in the same time.
            alike = sum(seconds >= (1 - 1e-9) * n * run.duration for n, run in enumerate(grid[0], 1))
            steps.append(Step(k, seconds, *widest(*plan, k), complete, widest(*grid, alike)[0]))
        return tuple(steps)

    def _advice(self, curve: Sequence[Step], enough: int, now: Now | None) -> str:
        """Return when to stop, in words."""
        if self.until is None:
            return "the plan uses all of the time: no precision was given that is enough"
        what = WORDS[self._goal]
        goal = percent(self.until)
        text = "" if now is None else f"the {what} is {_shown(now.widest)}; "
        if now is not None and now.reached:
            return f"stop: {text[:-2]}, and {goal} is enough"
        if now is not None and now.widest <= self.until:
            lack = "frequencies or levels are too few" if now.missing else "a discovery may leave a term out"
            text += f"{goal} is enough, but {lack}; "
        runs = counted_runs(enough, now is not None)
        if curve[enough - 1].highest <= self.until:
            return f"{text}after {runs} 95 of 100 tests reach a {what} of {goal}"
        last = percent(curve[-1].highest)
        return f"{text}not within this time: after {runs} 95 of 100 tests reach {last}, not {goal}"


def _shown(share: float) -> str:
    return percent(share) if np.isfinite(share) else "not known yet"


def _beyond_tested(known: Prior, runs: Sequence[PlannedRun]) -> tuple[str, ...]:
    """Return by how much the joint in the middle of its range leaves what was tested in planned runs, in one line."""
    law, tested = model_law(known.joint.model), known.tested
    if tested is None or not runs:
        return ()
    moved = []
    for run in runs:
        # A joint of the range does, near its limits.
        with suppress(SimulationError):
            moved.append(motion(law, run.drive, run.frequency, run.level, waveform=run.waveform))
    reached = {
        name: max((float(np.abs(getattr(each, name)).max()) for each in moved), default=0.0)
        for name in ("moment", "angle", "rate")
    }
    driven = [run.frequency * at for run in runs for at in driven_at(run.waveform)]
    slides = known.joint.model.joint.motion != "rotation"
    found = tested.beyond(reached, driven, [UNITS[name][slides] for name in reached])
    lines = [f"the planned runs leave the tested range: {found}"] if found else []
    if tested.band and tested.band[0] >= tested.band[1] * (1 - 1e-3):
        lines.append(
            "one frequency was tested: only a band that is given lets others show whether the law depends on it"
        )
    return tuple(lines)


def _warnings(found: Sequence[Prediction], compared: bool, model: JointModel) -> tuple[str, ...]:
    motion = model.joint.motion
    warnings = [
        f"a discovery would leave {spelled(each.id, motion)} out of {percent(1 - each.chosen)} of the joints of the "
        "range: it carries too little of the moment there"
        for each in found
        if each.chosen <= 0.975
    ]
    names = list_some([each.name for each in model.elements], "elements")
    known = (
        f"{names}: in every simulation as the model has it; intervals are those of the terms, as if its numbers were "
        "known"
    )
    short = "the time is too short for a grid of three frequencies and three levels"
    return (*warnings, *[known] * bool(names), *[short] * (not compared))


def predictions(model: JointModel, information: Information, coefficients: Array) -> tuple[Prediction, ...]:
    """Return the precision of each coefficient that is expected of runs; axes of the information are (runs, joints)."""
    chosen = chosen_terms(information, coefficients).mean(axis=0)
    rng = np.random.default_rng(0)
    widths = half_widths(information, rng, DRAWS).reshape(-1, len(model.terms))
    ends = np.quantile(widths, (0.05, 0.5, 0.95), axis=0, method="nearest")
    return tuple(
        Prediction(
            term.id, term.unit, term.coefficient, float(middle), (float(low), float(high)), float(share)
        )
        for term, low, middle, high, share in zip(model.terms, *ends, chosen, strict=True)
    )
