"""Effects as changes of the setup of a simulated structure, with scaled numbers that a fit can move; of its joints."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from sindyjoint.diagnosis.effects import Effect, Variant
from sindyjoint.diagnosis.effects.setup import PLACES, Scales, Setup
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.equation.terms import Reference
from sindyjoint.mechanics import FormulaLaw
from sindyjoint.numeric import Array


@dataclass(frozen=True, eq=False)
class Change:
    """One way in which one effect acts: numbers to which the response is proportional where small, then logarithms.

    Parameters
    ----------
    effect : Effect
    way : str
        Tells the ways of one effect apart.
    act : callable
        ``act(setup, values)`` returns the setup with the effect, of which ``values`` (SI) are the numbers.
    names : tuple of str
        Of the numbers.
    scales : ndarray, shape (k,)
        What one is of the first, linear ones, SI; at zero they do nothing.
    low, high : ndarray, shape (n,)
        Bounds of the scaled numbers, those of the nonlinear ones logarithms.
    units : dict of str to str
        Of the numbers by name.
    fallback : bool
        Whether it is tried only where no other way explains the gap.
    kind : str
        Of the joints in which it acts, where a structure has such kinds.
    """

    effect: Effect
    way: str
    act: Callable[[Setup, Array], Setup]
    names: tuple[str, ...]
    scales: Array
    low: Array
    high: Array
    units: dict[str, str] = field(default_factory=dict)
    fallback: bool = False
    kind: str = ""

    @property
    def size(self) -> int:
        """Numbers that a fit chooses."""
        return self.low.size

    @property
    def inside(self) -> bool:
        """Whether it acts in the joint."""
        return self.effect.enters not in PLACES

    @property
    def linear(self) -> range:
        """Places of the linear numbers."""
        return range(self.scales.size)

    @property
    def start(self) -> Array:
        """Numbers from which a fit begins: the effect does nothing there, where it can do nothing."""
        return np.append(np.zeros(self.scales.size), (0.5 * (self.low + self.high))[self.scales.size :])

    @property
    def grid(self) -> Array:
        """Starting points of a search, shape (m, n)."""
        low, high = self.low[self.scales.size :], self.high[self.scales.size :]
        # Points of a search over the nonlinear parameters, by their number.
        shape = {0: (), 1: (5,), 2: (3, 2), 3: (3, 1, 2)}.get(low.size, (2,) * low.size)
        axes = [a + (b - a) * (np.arange(n) + 0.5) / n for a, b, n in zip(low, high, shape, strict=True)]
        mesh = (
            np.array(np.meshgrid(*axes, indexing="ij")).reshape(low.size, -1).T if axes else np.zeros((1, 0))
        )
        return np.column_stack([np.zeros((len(mesh), self.scales.size)), mesh])

    def values(self, x: Array) -> Array:
        """Return scaled numbers in SI."""
        count = self.scales.size
        return np.append(self.scales * x[:count], np.exp(x[count:]))

    def apply(self, setup: Setup, x: Array) -> Setup:
        """Return the setup with the effect."""
        return self.act(setup, self.values(x))

    def report(self, x: Array) -> dict[str, float]:
        """Return the numbers by name, SI."""
        return dict(zip(self.names, map(float, self.values(x)), strict=True))


def structure_changes(effects: Sequence[Effect], setup: Setup, scales: Scales) -> tuple[Change, ...]:
    """Return the ways in which effects outside the joints can act on a setup."""
    return tuple(change for effect in effects for change in _ways(effect, setup, scales))


def _ways(effect: Effect, setup: Setup, scales: Scales) -> list[Change]:
    changes = []
    for way in PLACES[effect.enters](setup, scales):

        def act(setup: Setup, values: Array, change: Callable[[Setup, float], Setup] = way.act) -> Setup:
            return change(setup, float(values[0]))

        (number,) = effect.variants[0].parameters
        low, high = np.clip([number.lower, number.upper], way.least, way.most)
        changes.append(
            Change(
                effect, way.name, act, (number.name,), np.array([way.unit]), np.array([low]), np.array([high]),
                {number.name: number.unit},
            )
        )  # fmt: skip
    return changes


FRICTION = "coulomb_friction"
# Steady slip is looked at over this many times the largest angle, at this many times the largest rate.
FAR, FAST = 50.0, 100.0
# Moment that an effect adds at most, of the largest.
LARGEST = 1.5


@dataclass(frozen=True, eq=False)
class Addition:
    """A variant of an effect as part of a law: its symbols carry the key, so that several can stand side by side.

    Parameters
    ----------
    key : str
    variant : Variant
    replaces : bool
        Whether it stands in the place of the Coulomb friction.
    """

    key: str
    variant: Variant
    replaces: bool

    def name(self, inner: str) -> str:
        """Return the name of a parameter or state in the law."""
        return f"{self.key}_{inner}"

    @property
    def names(self) -> dict[str, str]:
        """What the variant's parameters and states are called in the law."""
        own = (*self.variant.names, *(state.name for state in self.variant.states))
        return {inner: self.name(inner) for inner in own}


class JointLaws:
    """The laws of a model with additions, each built once and given other numbers afterwards.

    Parameters
    ----------
    model : JointModel
    softening_limit : (float, float)
        rad.
    """

    def __init__(self, model: JointModel, softening_limit: tuple[float, float]):
        self.terms = tuple(term for term in model.terms if term.id != INERTIA)
        self.elements = model.elements
        self.limit = softening_limit
        self.additions: dict[str, Addition] = {}
        self._built: dict[tuple[str, ...], FormulaLaw] = {}

    def numbers(self) -> dict[str, float]:
        """Return the model's numbers by the names they have in the law: of its terms, then of its elements."""
        elements = {f"{place_of(e.id)}_{n.name}": n.value for e in self.elements for n in e.numbers}
        return {place_of(term.id): term.coefficient for term in self.terms} | elements

    def law(self, setup: Setup) -> FormulaLaw:
        """Return the law of a setup's joint."""
        if setup.added not in self._built:
            self._built[setup.added] = self._build(setup.added, setup.numbers)
        return self._built[setup.added].with_parameters(setup.numbers)

    def _build(self, keys: tuple[str, ...], numbers: dict[str, float]) -> FormulaLaw:
        from sympy import Float, Symbol

        added = [(a, *a.variant.written(a.names)) for a in (self.additions[key] for key in keys)]
        replacing = [(each, columns[0]) for each, columns, _ in added if each.replaces]
        expression: Any = Float(0)
        for term in self.terms:
            column = term.expression
            if term.id == FRICTION and replacing:
                # Two sliders in series make no sense: each takes an equal part of the friction.
                parts = [own / Symbol(each.name("level"), positive=True) for each, own in replacing]
                column = sum(parts) / len(parts)
            expression += Symbol(place_of(term.id), real=True) * column
        rates: dict[str, Any] = {}
        for element in self.elements:
            inner = (*element.form.names, *(state.name for state in element.form.states))
            columns, own_rates = element.form.written(
                {name: f"{place_of(element.id)}_{name}" for name in inner}
            )
            for value, column in zip(element.columns, columns, strict=True):
                expression += Symbol(f"{place_of(element.id)}_{value.name}", real=True) * column
            rates |= own_rates
        for each, columns, own_rates in added:
            if not each.replaces:
                for place, column in enumerate(columns):
                    expression += Symbol(each.name(f"c{place}"), real=True) * column
            rates |= own_rates
        return FormulaLaw(expression, dict(numbers), rates, softening_limit=self.limit)


def place_of(term: str) -> str:
    """Return the name of a model's coefficient in the law."""
    return f"model_{term}"


def joint_changes(
    laws: JointLaws, effects: Sequence[Effect], reference: Reference, moment: float
) -> tuple[Change, ...]:
    """Return the ways in which a joint's law may differ from the model's; the laws learn of the additions.

    Effects that need more than angle, rate and states are passed over: the structure has no other channel.
    ``reference`` holds the largest angle and rate of the joint, ``moment`` its largest moment, N·m.
    """
    own = {term.id for term in laws.terms}
    changes = [_released(term, reference, moment) for term in laws.terms]
    for effect in effects:
        if effect.enters != "moment" or effect.id in own:
            continue
        for index, variant in enumerate(effect.variants):
            if not variant.uses <= {"theta", "omega", *variant.names, *(s.name for s in variant.states)}:
                continue
            stands_in = FRICTION in own and _is_friction(variant, reference)
            for replaces in (True, False) if stands_in else (False,):
                key = f"{effect.id}_{index}{'r' if replaces else 'a'}"
                addition = Addition(key, variant, replaces)
                laws.additions[key] = addition
                change = _added(effect, addition, reference, moment)
                # Beside a friction that is there already, a second one is the less likely variant, and costs more.
                changes.append(replace(change, fallback=stands_in and not replaces))
    return tuple(changes)


def _released(term: Any, reference: Reference, moment: float) -> Change:
    """Return the error of a model's coefficient beyond what its covariance allows."""
    name, symbol, own = place_of(term.id), f"delta_{term.symbol}", float(term.coefficient)
    column = _at_reference(term.expression, {}, reference)
    scale = min(moment / column, 3 * abs(own)) if column > 0 else abs(own)
    scale = scale or abs(own) or 1.0
    rubs = term.id == FRICTION and own >= 0

    def act(setup: Setup, values: Array) -> Setup:
        value = setup.numbers[name] + float(values[0])
        return replace(setup, numbers={**setup.numbers, name: max(value, 0.0) if rubs else value})

    lowest = max(-own / scale, -1.0) if rubs else -1.0
    return Change(
        Effect(term.id, term.name, term.family, term.name), "released", act, (symbol,), np.array([scale]),
        np.array([lowest]), np.ones(1), {symbol: term.unit},
    )  # fmt: skip


def _added(effect: Effect, addition: Addition, reference: Reference, moment: float) -> Change:
    variant = addition.variant
    bounds = np.log(variant.bounds(reference)).reshape(-1, 2)
    columns = () if addition.replaces else variant.columns
    inner = dict(zip(variant.names, np.exp(bounds.mean(axis=1)), strict=True))
    sizes = [_at_reference(c.expression, inner, reference, variant) for c in columns]

    def act(setup: Setup, values: Array) -> Setup:
        coefficients, own = np.split(values, [len(columns)])
        named = {addition.name(n): float(v) for n, v in zip(variant.names, own, strict=True)}
        named |= {addition.name(f"c{i}"): float(value) for i, value in enumerate(coefficients)}
        if addition.replaces:
            named[addition.name("level")] = steady_level(variant, own, reference, FAST)
        keys = setup.added if addition.key in setup.added else (*setup.added, addition.key)
        return replace(setup, added=keys, numbers={**setup.numbers, **named})

    return Change(
        effect, addition.key, act, (*(c.symbol for c in columns), *variant.names),
        moment / np.maximum(np.array(sizes, dtype=float), 1e-300),
        np.append([0.0 if c.positive else -LARGEST for c in columns], bounds[:, 0]),
        np.append(np.full(len(columns), LARGEST), bounds[:, 1]), variant.units("rotation"),
    )  # fmt: skip


def _at_reference(
    expression: Any, inner: dict[str, float], reference: Reference, variant: Variant | None = None
) -> float:
    """Return the size of a column at the largest angle and rate, states as large as the angle."""
    angle, rate = reference.angle or 1.0, reference.rate or 1.0
    states = () if variant is None else tuple(s.name for s in variant.states)
    law = FormulaLaw(expression, inner, {name: expression for name in states})
    grid = np.array([0.25, 0.5, 0.75, 1.0])
    z = np.tile(grid * angle, (len(states), 1))
    return float(np.abs(law.moment(grid * angle, grid * rate, np.ones(4), z)).max())


def steady_level(variant: Variant, values: Array, reference: Reference, fast: float) -> float:
    """Return what the first column of a variant comes to under steady slip; NaN where it comes to nothing steady.

    The state settles where its rate first vanishes, or at its limit.
    """
    if len(variant.states) != 1 or len(variant.columns) != 1:
        return float("nan")
    state = variant.states[0]
    inner = dict(zip(variant.names, map(float, values), strict=True))
    column = FormulaLaw(variant.columns[0].expression, inner, {state.name: state.rate})
    rate = fast * (reference.rate or 1.0)
    if state.limit is None:
        z = np.geomspace(1e-4, FAR, 400) * (reference.angle or 1.0)
        slopes = column.state_rate(np.zeros(400), np.full(400, rate), np.ones(400), z[None])[0]
        falls = np.flatnonzero(slopes <= 0)
        if not falls.size or falls[0] == 0:
            return float("nan")
        i = int(falls[0])
        settled = z[i - 1] + (z[i] - z[i - 1]) * slopes[i - 1] / (slopes[i - 1] - slopes[i])
    else:
        limit = FormulaLaw(state.limit, inner)
        settled = float(limit.moment(0.0, 0.0, 1.0))
    return float(column.moment(0.0, rate, 1.0, np.array([[settled]])))


def _is_friction(variant: Variant, reference: Reference) -> bool:
    """Return whether under steady slip the moment no longer depends on the rate."""
    bounds = variant.bounds(reference)
    values = np.sqrt(bounds.prod(axis=1))
    once, twice = (steady_level(variant, values, reference, f) for f in (FAST, 2 * FAST))
    return bool(np.isfinite(once) and once > 0 and abs(twice / once - 1) < 1e-3)
