"""What every file of an export says: harmless text, and how well the target represents the model."""

import re
import textwrap
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sindyjoint.described import Maybe
from sindyjoint.equation.element import JointElement, states_along
from sindyjoint.equation.equation_text import Style, one_line
from sindyjoint.equation.formula import compile_terms, formula_text, variable_symbols
from sindyjoint.equation.model import INERTIA, JointModel, ModelTerm
from sindyjoint.export.parts import GIVE, POINTS, RAMP, Curve, Parts, contribution, total
from sindyjoint.limits import STATES
from sindyjoint.numeric import Array
from sindyjoint.text import Quantities, in_columns, quantities


@dataclass(frozen=True)
class Fidelity:
    """A row of the fidelity table.

    Parameters
    ----------
    term, symbol : str
        Id of the term or element and symbol of its coefficient; the last row is :data:`ALL_TERMS`.
    representation : str
        How the target represents it; for what is left out, "not carried" and why.
    carried : bool
    error, largest_error : float
        RMS and largest deviation from the term of the model over the tested range, as shares of the RMS moment of the
        test; over moving states, as everywhere: at a reversal friction is set-valued, and the representation says in
        words how the target sticks. For an omitted term this is the error of omitting it.
    """

    term: str
    symbol: str
    representation: str
    carried: bool
    error: Maybe
    largest_error: Maybe


def ascii_line(text: str) -> str:
    """Return one line of ASCII: accents dropped, Greek letters by name, other characters as question marks.

    Examples
    --------
    >>> ascii_line("Gelenk Süd, θ")
    'Gelenk Sud, theta'
    """
    plain = unicodedata.normalize("NFKD", one_line(text))
    return "".join(_ascii(c) for c in plain if not unicodedata.combining(c))


def _ascii(character: str) -> str:
    if character.isascii():
        return character
    name = unicodedata.name(character, "")
    if name.startswith("GREEK SMALL LETTER "):
        return name.removeprefix("GREEK SMALL LETTER ").lower()
    return {"·": "*", "−": "-", "–": "-", "±": "+-", "≤": "<=", "≥": ">=", "⋅": "*"}.get(character, "?")


def number(value: float) -> str:
    """Return the shortest text that reads back as the same float, with a decimal point or exponent."""
    return repr(float(value))


@cache
def _environment() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    found = Environment(
        loader=PackageLoader("sindyjoint.export"),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=StrictUndefined,
    )
    found.filters |= {"number": number, "numbers": lambda values: " ".join(map(number, values))}
    return found


def filled_in(template: str, **parts: Any) -> str:
    """Return the text of a deck from its template, which ships with the package."""
    return _environment().get_template(template).render(**parts)


ALL_TERMS = "all terms"


def words_of(model: JointModel) -> Quantities:
    """Return words and units for the motion of a model, in small letters."""
    own = quantities(model.joint.motion)
    return replace(own, moment=own.moment.lower(), angle=own.angle.lower(), rate=own.rate.lower())


def heading(model: JointModel, target: str) -> list[str]:
    """Return what every file says first: joint, origin, equation, units."""
    words, fitted = words_of(model), model.fitted
    # Of samples without time there is no rate.
    rate = "without time" if fitted.quasi_static else f"{fitted.rate:.6g} {words.angle_unit}/s"
    return [
        f"Joint: {one_line(model.joint.name)}",
        f"Written by sindyjoint for {target}. Units: {words.angle_unit}, {words.moment_unit}, s, {words.inertia_unit} "
        "(SI)",
        f"Equation: {ASCII.equation(model.joint, model.terms, model.elements)}",
        f"Tested up to {fitted.angle:.6g} {words.angle_unit} and {rate}; RMS "
        f"{words.moment} {fitted.moment_rms:.6g} {words.moment_unit}"
        + ("; from simulated tests" if fitted.simulated else "")
        + (
            ""
            if fitted.mean_known
            else f"; the mean {words.angle} was not measured: zero is where the {words.moment} is"
        ),
    ]


ASCII = Style(formula_text, ascii_line, "*", ("I*alpha", "m*a"), "d{}/dt = {}{}", " with |{}| <= {}", "; ")


def fidelity_lines(rows: Sequence[Fidelity]) -> list[str]:
    """Return the fidelity table as aligned lines of text."""
    cells = [
        ("term", "symbol", "RMS error", "largest", "represented as"),
        *((r.term, r.symbol, _percent(r.error), _percent(r.largest_error), r.representation) for r in rows),
    ]
    return [
        "Fidelity over the moving states of the tested range, errors in % of the RMS moment:",
        *in_columns([[one_line(cell) for cell in line] for line in cells]),
    ]


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share > 1e-12 else "0"


def preamble(model: JointModel, target: str, rows: Sequence[Fidelity], notes: Sequence[str]) -> list[str]:
    """Return heading, fidelity table, what is not carried, and notes."""
    held = () if any(term.inputs for term in model.terms) else model.inputs
    missing = [
        *(f"{each.label}: the law is that at {each.shown(each.reference)}" for each in held),
        *not_carried(rows),
    ]
    lines = [*heading(model, target), "", *fidelity_lines(rows), ""]
    lines += ["Not carried:", *(f"- {text}" for text in missing)] if missing else ["Everything is carried."]
    return [*lines, *(["", "Notes:", *(f"- {text}" for text in notes)] if notes else [])]


def not_carried(rows: Sequence[Fidelity]) -> tuple[str, ...]:
    """Return a sentence for each term or element that a table does not carry."""
    load = "force" if any(row.term == ALL_TERMS and row.symbol == "F" for row in rows) else "moment"
    return tuple(
        f"{row.term} ({row.symbol}): {row.representation.removeprefix('not carried: ')}; "
        f"leaving it out costs {100 * row.error:.3g} % of the RMS {load}"
        for row in rows
        if not row.carried and row.term != ALL_TERMS
    )


def comment(lines: Sequence[str], prefix: str, width: int = 110, ascii_only: bool = True) -> str:
    """Return lines as comments, wrapped, each after ``prefix``; ends with a line feed."""
    cleaned = ascii_line if ascii_only else one_line
    wrapped: list[str] = []
    for line in lines:
        # Columns of a table are aligned with spaces, which one_line would join.
        clean = "".join(part if part.isspace() else cleaned(part) for part in re.split("( {2,})", line))
        wrapped += textwrap.wrap(clean, width - len(prefix) - 1, subsequent_indent="    ") or [""]
    return "".join(f"{prefix} {part}".rstrip() + "\n" for part in wrapped)


@dataclass(frozen=True, eq=False)
class Cycles:
    """Harmonic motions that fill the tested range, on which representations are judged.

    Parameters
    ----------
    angle, rate : ndarray, shape (levels, phases)
        One whole cycle per row, rad and rad/s, from a tenth of the tested range to all of it. No rate is zero.
    step : float
        s between phases.
    """

    angle: Array
    rate: Array
    step: float

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Where the rate is large enough to say on which side friction is: the states that errors are taken over."""
        return np.abs(self.rate) >= STATES.periodic_rate_share * np.abs(self.rate).max(axis=1, keepdims=True)

    @classmethod
    def of(cls, model: JointModel) -> Self:
        """Return the cycles up to the largest angle and rate of the test of the model."""
        phases = 720
        level = np.linspace(0.1, 1, 10)[:, None]
        phase = (np.arange(phases) + 0.5) * 2 * np.pi / phases
        fitted = model.fitted
        step = 2 * np.pi * fitted.angle / fitted.rate / phases
        return cls(level * fitted.angle * np.sin(phase), level * fitted.rate * np.cos(phase), step)

    def term(self, term: ModelTerm) -> Array:
        """Moment of one term over the cycles; zero for one in the acceleration or an input, which no cycle defines."""
        if variable_symbols()[2] in term.expression.free_symbols or term.inputs:
            return np.zeros(self.angle.shape)
        return contribution(term, self.angle, self.rate)

    def states(self, element: JointElement) -> Array:
        """Return internal states of an element over the cycles once they repeat, shape (n_states, levels, phases)."""
        levels = [(angle, rate, self.step, 0.0) for angle, rate in zip(self.angle, self.rate, strict=True)]
        # A cycle is gone through so often, or until its internal states repeat.
        states = states_along(element.form, element.values, levels, 50)
        return states.reshape(-1, *self.angle.shape)

    def element(self, element: JointElement) -> Array:
        """Return the moment of an element over the cycles once they repeat."""
        return column_moments(element, self.angle, self.rate, self.states(element)) @ element.coefficients

    def slider(self, limit: Array, stiffness: float) -> Array:
        """Moment of a spring-slider (Jenkins) friction element over the cycles once they repeat.

        Parameters
        ----------
        limit : ndarray, shape (levels, phases), or (n, levels, phases) of several
            Moment at which it slides; not negative.
        stiffness : float
            While it sticks, N·m/rad.
        """
        moment = np.zeros(limit.shape)
        step = stiffness * np.diff(self.angle, axis=1, prepend=self.angle[:, -1:])
        last = np.clip(stiffness * self.angle[:, -1], -limit[..., -1], limit[..., -1])
        for i in [*range(self.angle.shape[1])] * 2:  # the first round forgets the start
            last = np.clip(last + step[:, i], -limit[..., i], limit[..., i])
            moment[..., i] = last
        return moment


def column_moments(element: JointElement, angle: Array, rate: Array, states: Array) -> Array:
    """Return the columns of an element at states, shape (..., n_columns)."""
    return evaluated(element, [column.expression for column in element.form.columns], angle, rate, states)


def evaluated(
    element: JointElement, formulas: Sequence[Any], angle: Array, rate: Array, states: Array
) -> Array:
    """Return formulas of an element at states, shape (..., n_formulas)."""
    given = np.broadcast_arrays(angle, rate, *states)
    flat = [np.ascontiguousarray(x, dtype=np.float64).ravel() for x in given]
    found = compile_terms(formulas, element.form.arguments)(*flat, *map(float, element.values))
    return np.asarray(found).reshape(*given[0].shape, len(formulas))


@dataclass(frozen=True, eq=False)
class Represented:
    """What a target does with one term or element.

    Parameters
    ----------
    how : str
        For the table.
    moment : ndarray, shape (levels, phases), or None
        Represented moment over the cycles; ``None`` for what is not carried.
    """

    how: str
    moment: Array | None


Rows = dict[str, Represented]


def fidelity_table(
    model: JointModel, cycles: Cycles, represented: Mapping[str, Represented], total: Array | None = None
) -> tuple[Fidelity, ...]:
    """Compare what a target represents with the model.

    Parameters
    ----------
    model : JointModel
    cycles : Cycles
    represented : mapping of str to :class:`~sindyjoint.export.fidelity.Represented`
        By id; every term and every element must be there.
    total : ndarray, shape (levels, phases), optional
        Moment of the exported form as written, rounding included; otherwise the sum over the terms.
    """
    rows, moving, reference = [], cycles.moving, model.fitted.moment_rms
    exact, carried = np.zeros(cycles.angle.shape), np.zeros(cycles.angle.shape)
    parts: list[tuple[ModelTerm | JointElement, Array]] = [(term, cycles.term(term)) for term in model.terms]
    for term, moment in [*parts, *((each, cycles.element(each)) for each in model.elements)]:
        item = represented[term.id]
        given = np.zeros_like(moment) if item.moment is None else item.moment
        exact, carried = exact + moment, carried + given
        errors = shares((given - moment)[moving], reference)
        rows.append(Fidelity(term.id, term.symbol, item.how, item.moment is not None, *errors))
    errors = shares(((carried if total is None else total) - exact)[moving], reference)
    symbol, complete = "M" if model.joint.motion == "rotation" else "F", all(row.carried for row in rows)
    return (*rows, Fidelity(ALL_TERMS, symbol, "the exported form as a whole", complete, *errors))


def shares(difference: Array, reference: float) -> tuple[float, float]:
    """Return RMS and largest difference as shares of the RMS moment of the test."""
    return (
        float(np.sqrt(np.mean(difference**2))) / reference,
        float(np.max(np.abs(difference))) / reference,
    )


def elastic_curve(parts: Parts, count: int) -> Curve:
    """Tabulate the elastic part over the tested range at an odd number of points."""
    nodes = parts.elastic_nodes(count)
    return Curve(nodes, total(parts.elastic, nodes, 0.0))


def elastic_rows(parts: Parts, cycles: Cycles, nodes: Array, how: str) -> Rows:
    """Return what a table at the nodes makes of each elastic term."""
    return {
        term.id: Represented(how, Curve(nodes, contribution(term, nodes, 0.0))(cycles.angle))
        for term in parts.elastic
    }


def rate_curve(parts: Parts, terms: tuple[ModelTerm, ...]) -> Curve:
    """Tabulate terms of the rate; a jump at zero rate becomes a ramp."""
    # Denser towards zero, where friction ramps up.
    positive = np.unique(np.concatenate([np.geomspace(RAMP, 1, 16), np.linspace(0.05, 1, 20)]))
    nodes = parts.model.fitted.rate * np.concatenate([-positive[::-1], [0.0], positive])
    return Curve(nodes, total(terms, 0.0, nodes))


def rate_rows(parts: Parts, terms: tuple[ModelTerm, ...], cycles: Cycles, nodes: Array, how: str) -> Rows:
    """Return what a table at the nodes makes of each term of the rate."""
    rate = words_of(parts.model).rate
    jump = f", its jump a ramp up to {RAMP:g} of the tested {rate}; creeps instead of sticking"
    return {
        term.id: Represented(
            how + (jump if jump_of(term, float(nodes.max())) else ""),
            Curve(nodes, contribution(term, 0.0, nodes))(cycles.rate),
        )
        for term in terms
    }


def jump_of(term: ModelTerm, rate: float) -> float:
    """Half the jump of a term of the rate at zero rate, N·m, with an accuracy of 1e-9 of the tested rate."""
    ahead, behind = contribution(term, 0.0, np.array([1e-9, -1e-9]) * rate)
    half = (ahead - behind) / 2
    size = np.abs(contribution(term, 0.0, rate))
    return float(half) if abs(half) > 1e-6 * max(float(size), abs(half)) else 0.0


def exact_rows(terms: Iterable[ModelTerm], cycles: Cycles, how: str) -> Rows:
    """Return rows for terms that a target carries exactly."""
    return {term.id: Represented(how, cycles.term(term)) for term in terms}


def exact_table(
    model: JointModel, term: str, element: str, other: Mapping[str, Represented]
) -> tuple[Fidelity, ...]:
    """Return the table of a target that holds terms and elements as they are, by its words for them, but for others."""
    cycles = Cycles.of(model)
    elements = {each.id: Represented(element, cycles.element(each)) for each in model.elements}
    return fidelity_table(model, cycles, {**exact_rows(model.terms, cycles, term), **elements, **other})


def inertial_rows(parts: Parts) -> Rows:
    """Return rows for inertia, which belongs to the masses of a structure, not to the joint's elements."""
    return {
        term.id: Represented(
            "not carried: the inertia of the test article belongs to the masses of the structure"
            if term.id == INERTIA
            else "not carried: a formula of the acceleration",
            None,
        )
        for term in parts.inertial
    }


def left_out(terms: tuple[ModelTerm, ...], why: str) -> Rows:
    """Return rows for terms that are not carried."""
    return {term.id: Represented(f"not carried: {why}", None) for term in terms}


def inertia_note(model: JointModel) -> tuple[str, ...]:
    """Return the note on the inertia of the test, where it is known."""
    if model.inertia == 0:
        return ()
    return (
        f"the moving inertia of the test, {model.inertia:.6g} {words_of(model).inertia_unit}, is not in the joint's "
        "elements: it belongs to the masses of the structure around it",
    )


def range_note(model: JointModel, beyond: str) -> str:
    """Return the note on the tested range."""
    fitted = model.fitted
    unit = words_of(model).angle_unit
    return f"tables cover the tested range, {fitted.angle:.6g} {unit} and {fitted.rate:.6g} {unit}/s; beyond, {beyond}"


def sliding_limit(parts: Parts, terms: tuple[ModelTerm, ...]) -> tuple[Curve, float]:
    """Return the moment at which friction slides over the angle, and its stiffness while it sticks; 0: it cannot be."""
    nodes = parts.elastic_nodes(POINTS) if any(term in parts.coupled for term in terms) else np.zeros(1)
    # At an infinitely small positive rate the sign is 1 and nothing else remains.
    limit = total(terms, nodes, 1e-300)
    return Curve(nodes, limit), float(limit.max() * np.all(limit >= 0)) / (GIVE * parts.model.fitted.angle)


def sliding_rows(
    parts: Parts, terms: tuple[ModelTerm, ...], cycles: Cycles, how: str, where: str = ""
) -> Rows:
    """Return rows for friction as a stiff spring in series with a slider, which a target calls ``how``.

    ``where`` it must not be negative: a limit that changes with the angle, anywhere.
    """
    limit, stiffness = sliding_limit(parts, terms)
    if not stiffness:
        return left_out(terms, f"friction must not be negative{where}")
    share = {t.id: np.interp(cycles.angle, limit.x, contribution(t, limit.x, 1e-300)) for t in terms}
    whole = sum(share.values(), np.zeros(cycles.angle.shape))
    slider = cycles.slider(whole, stiffness)
    how += f"; sticks as a spring that gives way by {GIVE:g} of the tested {words_of(parts.model).angle}"
    # Each term takes its share of the one slider.
    safe = np.where(whole > 0, whole, 1.0)
    return {term: Represented(how, slider * own / safe) for term, own in share.items()}


def sliding_note(model: JointModel, stiffness: float, more: str = "") -> tuple[str, ...]:
    """Return the note on the spring of sticking friction, where there is any."""
    words = words_of(model)
    size = f"{stiffness:.6g} {words.moment_unit}/{words.angle_unit}"
    return (f"while it sticks, friction is a spring of {size}{more}",) if stiffness > 0 else ()
