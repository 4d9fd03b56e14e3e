"""Whether a joint has changed between two tests: coefficient by coefficient, beyond noise and calibration.

A coefficient has *changed* where its difference passes its error by more than chance explains in any of all
coefficients (Bonferroni, 5 % over all). It is *the same within the margin* where every change beyond the margin is
ruled out (two one-sided tests, Schuirmann 1987); both can be true of sharp estimates. Otherwise nothing is decided.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal, NamedTuple

import numpy as np
import scipy

from sindyjoint.described import Maybe, Shown, same
from sindyjoint.equation.calibration import gain_errors
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError
from sindyjoint.limits import JUDGEMENT

Answer = Literal["changed", "changed within margin", "the same within margin", "cannot tell", "not compared"]
# Degrees of freedom that are as good as any number of them.
MANY = 1e6
# Between the name of a number of an element and the form of that.
FORM = " in "


@dataclass(frozen=True)
class Shift:
    """A coefficient, or a number of an element, before and after.

    Parameters
    ----------
    id, symbol, name, unit : str
    before, after : float
        SI; NaN where a test has no such term.
    interval_before, interval_after : (float, float)
    change : float
        Relative to the value before.
    interval : (float, float)
        95 % interval of the relative change, noise and calibration in it.
    p_value : float
        Of "the same".
    answer : str
    """

    id: str
    symbol: str
    name: str
    unit: str
    before: Maybe
    after: Maybe
    interval_before: tuple[Maybe, Maybe]
    interval_after: tuple[Maybe, Maybe]
    change: Maybe
    interval: tuple[Maybe, Maybe]
    p_value: Maybe
    answer: Answer


@dataclass(frozen=True, eq=False, repr=False)
class Change(Shown):
    """What two tests of one joint say.

    Parameters
    ----------
    before, after : JointModel
        As compared: of the same terms, inputs at the same values.
    shifts : tuple of Shift
    margin : float
        Relative change that would not matter.
    names : (str, str)
        What the two are called.
    warnings : tuple of str
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {
        "joint": "after.joint.name",
        "before": "name_before",
        "after": "name_after",
        **same("changed", "sentence", "margin"),
        "coefficients": "shifts",
        "warnings": "warnings",
    }
    before: JointModel
    after: JointModel
    shifts: tuple[Shift, ...]
    margin: float
    names: tuple[str, str]
    warnings: tuple[str, ...] = ()

    @property
    def name_before(self) -> str:
        """What the first test is called."""
        return self.names[0]

    @property
    def name_after(self) -> str:
        """What the second test is called."""
        return self.names[1]

    @property
    def moved(self) -> tuple[Shift, ...]:
        """Coefficients that changed."""
        return tuple(shift for shift in self.shifts if shift.answer.startswith("changed"))

    @property
    def changed(self) -> bool:
        """Whether any did."""
        return bool(self.moved)

    @property
    def simulated(self) -> bool:
        """Whether one of the tests was a virtual one."""
        return self.before.fitted.simulated or self.after.fitted.simulated

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        if self.moved:
            listed = ", ".join(f"{s.symbol} by {100 * s.change:+.2g} %" for s in self.moved)
            return f"changed: {listed}"
        compared = [shift for shift in self.shifts if shift.answer != "not compared"]
        if not compared:
            return "not compared: the two have no term in common"
        if all(shift.answer.startswith("the same") for shift in compared):
            return f"the same: every change beyond {100 * self.margin:.3g} % is ruled out"
        unsure = ", ".join(s.symbol for s in compared if s.answer == "cannot tell")
        return (
            f"no change is seen, yet one of more than {100 * self.margin:.3g} % is not ruled out for {unsure}: "
            "record longer, or allow a wider margin"
        )


def check_margin(margin: float) -> None:
    """Raise InputError for a margin that is no relative change."""
    if not 0 < margin < 1:
        raise InputError(f"margin is {margin!r}; expected a relative change between 0 and 1")


def compare_models(
    before: JointModel,
    after: JointModel,
    margin: float = JUDGEMENT.margin,
    same_sensors: bool = False,
    names: tuple[str, str] = ("before", "after"),
    warnings: tuple[str, ...] = (),
) -> Change:
    """Compare the coefficients of two models of one joint, and the numbers of their elements.

    Parameters
    ----------
    before, after : JointModel
    margin : float
        Relative change that would not matter.
    same_sensors : bool
        Whether both tests were made with the same sensors in the same calibration: gain errors that the models declare
        are then the same in both, and no part of the difference.
    names : (str, str)
    warnings : tuple of str

    Raises
    ------
    InputError
        For models of different motion, or a margin that is not positive.
    """
    if before.joint.motion != after.joint.motion:
        raise InputError(
            f"one is of a joint in {before.joint.motion}, the other in {after.joint.motion}; expected the same joint"
        )
    check_margin(margin)
    notes = [*warnings]
    if before.joint.name != after.joint.name:
        notes.append(f"the joints have different names: {before.joint.name!r} and {after.joint.name!r}")
    common = {each.name: each.reference for each in before.inputs}
    if after.inputs:
        after = _at_references(after, common)
    rows = [_rows(model, same_sensors) for model in (before, after)]
    ids = list(dict.fromkeys([*rows[0], *rows[1]]))
    both = [name for name in ids if all(name in known for known in rows)]
    only = ", ".join(name.partition(FORM)[0] for name in ids if name not in both)
    if only:
        notes.append(
            f"{only} stand(s) in one of the two only; what is left to the others differs by that: give both campaigns, "
            "and the same terms are fitted to both"
        )
    level = JUDGEMENT.level / max(len(both), 1)
    shifts = tuple(_shift(rows[0].get(name), rows[1].get(name), level, margin) for name in ids)
    return Change(before, after, shifts, margin, names, tuple(notes))


class _Row(NamedTuple):
    """A number of a model, and the part of its error that is the same in the other test."""

    id: str
    symbol: str
    name: str
    unit: str
    value: float
    standard_error: float
    interval95: tuple[float, float]
    common: float


def _rows(model: JointModel, same_sensors: bool) -> dict[str, _Row]:
    """Return the coefficients of a model and the numbers of its elements; of another form they are other numbers."""
    gains = gain_errors(model) if same_sensors else np.zeros(len(model.terms))
    rows = [
        _Row(t.id, t.symbol, t.name, t.unit, t.coefficient, t.standard_error, t.interval95, float(gain))
        for t, gain in zip(model.terms, gains, strict=True)
    ]
    keys = [*model.ids]
    for element in model.elements:
        form = "; ".join([*(c.formula for c in element.columns), *(s.rate for s in element.states)])
        for n in element.numbers:
            name, words = f"{element.id}.{n.name}", f"{n.name} of {element.name}"
            rows.append(_Row(name, n.name, words, n.unit, n.value, n.standard_error, n.interval95, 0.0))
            keys.append(f"{name}{FORM}{form}")
    return dict(zip(keys, rows, strict=True))


def _at_references(model: JointModel, common: dict[str, float]) -> JointModel:
    """Return a model whose plain terms hold at other references of its inputs; the dependences stay."""
    known = {each.name for each in model.inputs}
    held = model.at(**{name: value for name, value in common.items() if name in known})
    kept = [term for term in model.terms if term.inputs]
    return held.with_terms(
        (*held.terms, *(term for term in kept if term.id not in held)),
        np.diag(
            [
                *(t.standard_error**2 for t in held.terms),
                *(t.standard_error**2 for t in kept if t.id not in held),
            ]
        ),
    )


def _error_of(row: _Row) -> tuple[float, float]:
    """Return the standard error of a number less what is the same in the other test, and its degrees of freedom.

    The degrees are those by which its 95 % interval is wider than one of a normal distribution.
    """
    error = row.standard_error
    left = float(np.sqrt(max(error**2 - row.common**2, 0.0)))
    ratio = (row.interval95[1] - row.interval95[0]) / 2 / error if error > 0 else 0.0
    if ratio <= scipy.special.stdtrit(MANY, 0.975):
        return left, MANY
    few = scipy.optimize.brentq(
        lambda log: scipy.special.stdtrit(np.exp(log), 0.975) - min(ratio, scipy.special.stdtrit(1, 0.975)),
        0.0,
        np.log(MANY),
    )
    return left, float(np.exp(few))


def _shift(one: _Row | None, other: _Row | None, level: float, margin: float) -> Shift:
    nan, unknown = float("nan"), (float("nan"), float("nan"))
    if one is None or other is None:
        row = one or other
        assert row is not None
        return Shift(
            row.id, row.symbol, row.name, row.unit,
            nan if one is None else row.value, nan if other is None else row.value,
            unknown if one is None else row.interval95, unknown if other is None else row.interval95,
            nan, unknown, nan, "not compared",
        )  # fmt: skip
    errors = [_error_of(row) for row in (one, other)]
    # The degrees of a difference of which neither variance is known (Welch 1947, Satterthwaite 1946).
    variances = np.array([error**2 for error, _ in errors])
    total = float(variances.sum())
    degrees = total**2 / float(np.sum(variances**2 / [d for _, d in errors])) if total > 0 else MANY
    error = float(np.sqrt(total))
    difference = other.value - one.value
    size = abs(one.value) or nan
    score = abs(difference) / error if error > 0 else (np.inf if difference else 0.0)
    chance = float(2 * scipy.special.stdtr(degrees, -score))
    found = chance < level
    # Two one-sided tests at 5 % each: an interval of 90 %.
    within = abs(difference) + error * scipy.special.stdtrit(degrees, 0.95) < margin * size
    half = float(error * scipy.special.stdtrit(degrees, 0.975))
    answer: Answer = (
        ("changed within margin" if within else "changed")
        if found
        else ("the same within margin" if within else "cannot tell")
    )
    change = difference / size
    return Shift(
        one.id, one.symbol, one.name, one.unit, one.value, other.value, one.interval95, other.interval95,
        change, (change - half / size, change + half / size), chance, answer,
    )  # fmt: skip
