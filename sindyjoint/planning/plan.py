"""A plan: its runs, what is expected of them, when to stop, and how surely they separate effects."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from sindyjoint.described import Maybe, Shown, same
from sindyjoint.equation.model import JointModel
from sindyjoint.mechanics.excitation import Actuator
from sindyjoint.numeric import Array
from sindyjoint.planning.information import Information, Sensors, chosen_terms, half_widths
from sindyjoint.planning.runs import PlannedRun

TELL_APART = "tell-apart"


@dataclass(frozen=True)
class Separation:
    """How surely effects are told apart.

    Parameters
    ----------
    effects : tuple of str
        That are held against each other.
    before : float
        Probability that the true one of them has by the runs that were made, or by the plan's other runs; NaN where
        these show none of them.
    after : tuple of float
        The same after each further run that separates them, expected.
    words : str
        What that means; where no run that can be made separates them, that.
    """

    effects: tuple[str, ...]
    before: Maybe
    after: tuple[float, ...]
    words: str

    enough: ClassVar[float] = 0.9  # at which effects are told apart


# Joints on which the chosen runs, and the grid, are predicted, and what the scatter of a test makes of an interval on
# each, so many times; the 90 % band of 40 held 88.7 % of those of others.
DRAWS = 40


@dataclass(frozen=True)
class Prediction:
    """The precision of a coefficient that is expected of runs.

    Parameters
    ----------
    id, unit : str
    value : float
        In the middle of its range, SI.
    half_width95 : float
        Of its 95 % interval, median over joints and tests; infinite where the runs do not determine it.
    band90 : (float, float)
        Between these it lies in nine of ten tests of joints of the range.
    chosen : float
        Share of the joints of which a discovery is expected to take the term.
    """

    WRITTEN: ClassVar = same("half_width95", "unit", "band90", "chosen")
    id: str
    unit: str
    value: float
    half_width95: Maybe
    band90: tuple[Maybe, Maybe]
    chosen: float

    @property
    def relative(self) -> float:
        """Half-width as a share of the coefficient."""
        return self.half_width95 / abs(self.value) if self.value else float("inf")


@dataclass(frozen=True)
class Step:
    """What is known after some of the runs.

    Parameters
    ----------
    runs : int
    seconds : float
        Duration of all of them.
    widest, highest : float
        What the plan makes small, relative: median over joints and tests, and below what it lies in 95 of 100.
    complete : float
        Share of the joints of which a discovery is expected to take every term that matters.
    grid : float
        Median of the same of those of the plain grid's runs that are made in that time; infinite where they do not
        determine it.
    """

    runs: int
    seconds: float
    widest: Maybe
    highest: Maybe
    complete: float
    grid: Maybe


@dataclass(frozen=True)
class Now:
    """How far the runs that were made have come.

    Parameters
    ----------
    runs : int
    seconds : float
        Duration of all of them.
    widest : float
        What the plan makes small, relative, as the runs have given it; infinite where they do not.
    complete : float
        Share of the joints of the range of which a discovery of these runs is expected to take every term that matters.
    missing : int
        Different frequencies and levels that a discovery asks for and that are missing.
    reached : bool
        Whether that is enough.
    """

    runs: int
    seconds: float
    widest: Maybe
    complete: float
    missing: int
    reached: bool


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Shown):
    """The result of :func:`sindyjoint.plan`.

    Parameters
    ----------
    model : JointModel
        The joint in the middle of its range.
    low, high : tuple of float
        Range of each coefficient.
    actuator : Actuator
    sensors : Sensors
    goals : tuple of (str, float)
        What is made small, and how much each counts, the weightiest first.
    terms : tuple of str
        Coefficients that matter.
    runs : tuple of PlannedRun
        In the order in which they are to be made.
    predicted, grid : tuple of Prediction
        Of the plan, and of the grid of the same duration (empty where its runs would be too short), by term.
    grid_runs : tuple of PlannedRun
    curve : tuple of Step
    until : float or None
        Relative half-width that is enough.
    stop : str
        Whether, and when, to stop.
    warnings : tuple of str
    now : Now, optional
        What the runs of a campaign have reached.
    apart : Separation, optional
        How surely given effects are told apart.
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {
        "runs": "runs",
        "predicted": "predicted_by_term",
        "grid": "grid_by_term",
        **same("undetermined", "goal"),
        "goals": "weights",
        **same("apart", "now", "curve", "stop", "warnings"),
    }
    model: JointModel
    low: tuple[float, ...]
    high: tuple[float, ...]
    actuator: Actuator
    sensors: Sensors
    goals: tuple[tuple[str, float], ...]
    terms: tuple[str, ...]
    runs: tuple[PlannedRun, ...]
    predicted: tuple[Prediction, ...]
    grid: tuple[Prediction, ...]
    grid_runs: tuple[PlannedRun, ...]
    curve: tuple[Step, ...]
    until: float | None
    stop: str
    warnings: tuple[str, ...] = ()
    now: Now | None = None
    apart: Separation | None = None

    @property
    def goal(self) -> str:
        """What counts most."""
        return self.goals[0][0]

    @property
    def count(self) -> str:
        """How many runs are to be made, in words."""
        return counted_runs(len(self.runs), self.now is not None)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Terms whose interval is expected to hold zero, or that a discovery would leave out of most joints."""
        return tuple(each.id for each in self.predicted if not (each.relative < 1.0 and each.chosen > 0.5))

    @property
    def seconds(self) -> float:
        """Duration of all runs."""
        return sum(run.duration for run in self.runs)

    @property
    def weights(self) -> dict[str, float]:
        """How much each of what is made small counts."""
        return dict(self.goals)

    @property
    def predicted_by_term(self) -> dict[str, Prediction]:
        """What is expected of the plan."""
        return {each.id: each for each in self.predicted}

    @property
    def grid_by_term(self) -> dict[str, Prediction]:
        """What is expected of the grid of the same duration."""
        return {each.id: each for each in self.grid}


def counted_runs(count: int, further: bool) -> str:
    """Return a number of runs in words."""
    return f"{count} {'further ' * further}run{'s' * (count != 1)}"


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
