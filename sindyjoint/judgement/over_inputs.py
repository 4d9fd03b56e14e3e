"""A joint's law over its declared inputs: at each level, at three values, what is free of them, how late it follows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from sindyjoint.described import Maybe
from sindyjoint.discovery import Evidence
from sindyjoint.discovery.delay import ROWS, Columns, law_of_channels, law_rows
from sindyjoint.discovery.factors import Factor
from sindyjoint.discovery.frequency import Axis, FrequencyTest, frequency_test, group_estimates
from sindyjoint.equation.catalogue import load_catalogue
from sindyjoint.equation.formula import variable_symbols
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.inputs import Input, lagged, run_levels
from sindyjoint.limits import DISCOVERY
from sindyjoint.numeric import scaled_least_squares
from sindyjoint.states import ForceStates
from sindyjoint.text import list_all, spelled

if TYPE_CHECKING:
    import sympy


@dataclass(frozen=True)
class CoefficientOver:
    """A coefficient over an input.

    Parameters
    ----------
    id, symbol, unit : str
    values, errors : tuple of float
        Of the law at the values of the input, with standard errors; SI.
    intervals : tuple of (float, float)
        Of 95 %.
    levels, estimates, level_errors : tuple of float
        Levels of the input in its declared unit, and what the runs of each alone give; empty where it has no levels.
    answer, reason : str
        Of the test of equivalence; empty without levels.
    bound : float
        Largest relative change between two levels that is not ruled out, at 1 % risk.
    """

    id: str
    symbol: str
    unit: str
    values: tuple[float, ...]
    errors: tuple[float, ...]
    intervals: tuple[tuple[float, float], ...] = ()
    levels: tuple[float, ...] = ()
    estimates: tuple[float, ...] = ()
    level_errors: tuple[float, ...] = ()
    answer: str = ""
    reason: str = ""
    bound: Maybe = float("nan")


@dataclass(frozen=True)
class OverInput:
    """A law over one of its inputs, the others at their reference.

    Parameters
    ----------
    name, label, unit : str
        The unit is the declared one.
    values : tuple of float
        Least tested, reference and largest tested value, in that unit.
    coefficients : tuple of CoefficientOver
    """

    name: str
    label: str
    unit: str
    values: tuple[float, ...]
    coefficients: tuple[CoefficientOver, ...]

    def dependence(self, row: CoefficientOver) -> str:
        """Return the answer to whether a coefficient depends on the input, with its figure; empty where unknown."""
        independent = row.answer.startswith("independent")
        return f"independent of {self.label} within {100 * row.bound:.2g} %" if independent else row.answer

    @property
    def headings(self) -> tuple[str, ...]:
        """The values as they are written."""
        return tuple(f"{value:.4g} {self.unit}".removesuffix(" 1") for value in self.values)


def over_inputs(
    model: JointModel, evidence: Evidence, states: Sequence[ForceStates]
) -> tuple[OverInput, ...]:
    """Return the law over each input that was tested at more than one level.

    Parameters
    ----------
    model : JointModel
    evidence : Evidence
        That it was found in.
    states : sequence of ForceStates
        Of its runs.
    """
    return tuple(
        over_input(model, each, level_tests(evidence, states, model, each))
        for each in model.inputs
        if each.tested is not None and each.levels > 1
    )


def over_input(model: JointModel, each: Input, tests: Sequence[FrequencyTest] = ()) -> OverInput:
    """Return a law over one of its inputs, with tests of its coefficients where there are some."""
    low, high = each.tested or (each.reference, each.reference)
    values = sorted({low, min(max(each.reference, low), high), high})
    laws = [model.at(**{each.name: value}) for value in values]
    known = {test.name: test for test in tests}
    rows = []
    for term in laws[len(laws) // 2].terms:
        absent = replace(term, coefficient=0.0, standard_error=0.0, interval95=(0.0, 0.0))
        there = [law[term.id] if term.id in law else absent for law in laws]
        row = CoefficientOver(
            term.id,
            term.symbol,
            term.unit,
            tuple(t.coefficient for t in there),
            tuple(t.standard_error for t in there),
            tuple(t.interval95 for t in there),
        )
        if term.id in known:
            test = known[term.id]
            row = replace(
                row, levels=test.frequencies, estimates=test.estimates, level_errors=test.standard_errors,
                answer=test.answer, reason=test.reason, bound=test.change_bound,
            )  # fmt: skip
        rows.append(row)
    shown = tuple((value - each.zero) / each.factor for value in values)
    return OverInput(each.name, each.label, each.shown_unit, shown, tuple(rows))


def level_tests(
    evidence: Evidence,
    states: Sequence[ForceStates],
    model: JointModel,
    each: Input,
) -> tuple[FrequencyTest, ...]:
    """Test every term that does not hold the input for being the same at each of its levels.

    Nothing is returned where runs are not at one level each, or at fewer than three.
    """
    at = run_levels({s.run: s.inputs[each.name] for s in states if each.name in s.inputs}, each.tested)
    if any(run.name not in at for run in evidence.runs) or len(set(at.values())) < DISCOVERY.fewest:
        return ()
    runs = tuple(replace(run, group=f"{at[run.name]!r}") for run in evidence.runs)
    grouped = replace(evidence, runs=runs)
    plain = [term.id for term in model.terms if each.name not in term.inputs and term.id in evidence.ids]
    if not plain:
        return ()
    found = group_estimates(grouped, [evidence.ids.index(term) for term in plain])
    shown = (np.array([float(group) for group in found.groups]) - each.zero) / each.factor
    # Over all coefficients together: one that the law does not let depend is not to seem to by chance.
    margin = DISCOVERY.margin
    axis = Axis(each.label, each.shown_unit, DISCOVERY.level / len(plain))
    return tuple(
        frequency_test(
            term, shown, found.coefficients[:, i], found.standard_errors[:, i], found.degrees, margin, axis
        )
        for i, term in enumerate(plain)
        if np.all(found.standard_errors[:, i] > 0)
    )


@dataclass(frozen=True)
class LevelLaw:
    """What a model is where its inputs stand still.

    Parameters
    ----------
    ids : tuple of str
        Of its terms there, without inertia; a dependence goes by the term of the paper that it changes.
    dependences : tuple of (str, str)
        Ids of terms of the paper that depend on an input, and that input.
    """

    ids: tuple[str, ...]
    dependences: tuple[tuple[str, str], ...]

    def words(self, model: JointModel) -> str:
        """Return which coefficients depend on what; empty where none does."""
        labels = {each.name: each.label for each in model.inputs}
        parts = []
        for name in dict.fromkeys(name for _, name in self.dependences):
            terms = [spelled(term, model.joint.motion) for term, own in self.dependences if own == name]
            parts.append(f"{list_all(terms)} depend{'s' * (len(terms) == 1)} on {labels.get(name, name)}")
        return ", ".join(parts)


def law_at_levels(model: JointModel) -> LevelLaw:
    """Return the terms that a model has at each level of its inputs, and which of them depend on one."""
    ids, dependences = [], []
    for term in model.terms:
        changes = changed_term(term.expression) if term.inputs else None
        ids.append(changes or term.id)
        dependences += [(changes, name) for name in term.inputs] if changes else []
    return LevelLaw(
        tuple(name for name in dict.fromkeys(ids) if name != INERTIA), tuple(dict.fromkeys(dependences))
    )


def vanishing(model: JointModel, law: LevelLaw) -> tuple[tuple[str, str], ...]:
    """Return terms of which the coefficient changes its sign over the tested range of an input, and that input."""
    tested = {each.name: each.tested for each in model.inputs if each.tested is not None}
    found = []
    for term, name in law.dependences:
        if name not in tested:
            continue
        ends = [model.at(**{name: value}) for value in tested[name]]
        low, high = (held[term] if term in held else None for held in ends)
        if low is None or high is None or low.coefficient * high.coefficient >= 0:
            continue
        if all(abs(each.coefficient) > DISCOVERY.likely * each.standard_error for each in (low, high)):
            found.append((term, name))
    return tuple(found)


def changed_term(expression: sympy.Expr) -> str | None:
    """Return the term of the paper that a dependence is where its inputs stand still; None where it is none."""
    _, form = expression.as_independent(*variable_symbols(), as_Add=False)
    return _paper_forms().get(form)


@cache
def _paper_forms() -> dict[sympy.Expr, str]:
    return {term.expression: term.id for term in load_catalogue("paper")}


@dataclass(frozen=True)
class InputLag:
    """The lag with which a joint follows an input.

    Parameters
    ----------
    name : str
    time : float
        Time constant of the first-order lag, s.
    removed : float
        Share of the mean square that the law and its dependences left which the lag explains.
    """

    name: str
    time: float
    removed: float


def find_lags(
    states: Sequence[ForceStates], inertia: float | None, inputs: Sequence[Input]
) -> tuple[InputLag, ...]:
    """Return the lags of inputs that move within runs and of which none is declared.

    The paper's law, each of its coefficients linear in the inputs, is fitted with every time constant that is tried. A
    lag counts that explains a stated share of what is left without it.
    """
    # Time constants, s; the best is refined between its neighbours.
    tried = np.geomspace(1e-3, 3.0, 22)
    found: list[InputLag] = []
    for each in inputs:
        if each.lag or all(np.ptp(s.inputs[each.name]) == 0 for s in states):
            continue
        law = law_of_channels(inertia, inputs)
        lags = {lag.name: lag.time for lag in found}
        without = _left(states, law, inertia, lags)
        errors = [_left(states, law, inertia, lags | {each.name: float(time)}) for time in tried]
        best = int(np.argmin(errors))
        low, high = tried[max(best - 1, 0)], tried[min(best + 1, tried.size - 1)]
        finer = np.geomspace(low, high, 9)
        again = [_left(states, law, inertia, lags | {each.name: float(time)}) for time in finer]
        removed = 1 - min(again) / without if without > 0 else 0.0
        if removed > DISCOVERY.minor_share:
            found.append(InputLag(each.name, float(f"{finer[int(np.argmin(again))]:.3g}"), removed))
    return tuple(found)


def lag_notes(lags: Sequence[InputLag]) -> list[str]:
    """Return what a report says of lags that were found."""
    return [
        f"the joint follows {lag.name} with a lag of {1e3 * lag.time:.3g} ms (time constant), which explains "
        f'{100 * lag.removed:.0f} % of the mean square left without it; lag = "{1e3 * lag.time:.3g} ms" in [inputs] '
        "declares it"
        for lag in lags
    ]


def _left(
    states: Sequence[ForceStates],
    law: Columns,
    inertia: float | None,
    lags: Mapping[str, float],
) -> float:
    """Return the sum of squares that a law leaves of the moving samples."""
    stride = max(1, sum(s.n_samples for s in states) // ROWS)
    rows = []
    for state in states:
        values = {
            name: lagged(value, lags.get(name, 0.0) * state.sample_rate)
            for name, value in state.inputs.items()
        }
        rows.append(law_rows(replace(state, inputs=values), law, inertia, stride))
    columns, target = map(np.concatenate, zip(*rows, strict=True))
    triangle = Factor.of(columns, target).triangle
    solved = scaled_least_squares(triangle[:, :-1], triangle[:, -1], 1e-10)
    return float(np.sum((triangle[:, :-1] @ solved - triangle[:, -1]) ** 2))
