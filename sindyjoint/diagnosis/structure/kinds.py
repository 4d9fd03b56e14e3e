"""The joints of one kind in a structure: their model, and its numbers as a fit moves them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sindyjoint.diagnosis.effects.change import FRICTION, Change, JointLaws, place_of
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.effects.setup import Setup
from sindyjoint.diagnosis.structure import differences
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.errors import InputError
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.numeric import DIFFERENCE, Array, Integers, root_of
from sindyjoint.response.laws import model_law, physical_numbers


@dataclass(frozen=True, eq=False)
class JointKind:
    """The joints of one kind.

    Parameters
    ----------
    name : str
    places : tuple of int
        Numbers of the joints in the structure.
    model : JointModel
    laws : JointLaws
    kept : ndarray of int, shape (k,)
        Places of the model's numbers without the inertia.
    root : ndarray, shape (k, k)
        L: numbers are those of the model and L·u, u being what a fit moves.
    """

    name: str
    places: tuple[int, ...]
    model: JointModel
    laws: JointLaws
    kept: Integers
    root: Array

    @classmethod
    def of(cls, name: str, places: tuple[int, ...], model: JointModel, least: float) -> "JointKind":
        """Return joints whose numbers move by their covariance, each by `least` of itself at least."""
        laws = JointLaws(model, model_law(model).softening_limit)
        terms = [place for place, term in enumerate(model.terms) if term.id != INERTIA]
        kept = np.array([*terms, *range(len(model.terms), model.numbers.size)], dtype=np.intp)
        values, covariance = model.numbers[kept], model.covariance_matrix[np.ix_(kept, kept)]
        return cls(name, places, model, laws, kept, root_of(covariance + np.diag((least * values) ** 2)))

    @property
    def size(self) -> int:
        """How many numbers a fit moves."""
        return self.root.shape[1]

    def setup(self, u: Array) -> Setup:
        """Return the law's numbers as the setup of such a joint."""
        moved = self.model.numbers.copy()
        moved[self.kept] += self.root @ u
        moved = physical_numbers(self.model, moved)[self.kept]
        return Setup((), 0.0, dict(zip(self.laws.numbers(), moved.tolist(), strict=True)))

    def with_numbers(self, u: Array, covariance: Array) -> JointModel:
        """Return the model with its numbers moved by L·u, and the covariance of u as theirs."""
        numbers, whole = self.model.numbers.copy(), np.zeros((self.model.numbers.size,) * 2)
        numbers[self.kept] = list(self.setup(u).numbers.values())
        whole[np.ix_(self.kept, self.kept)] = self.root @ covariance @ self.root.T
        return self.model.with_numbers(numbers, (whole + whole.T) / 2)

    def change(self, change: Change, several: bool) -> Change:
        """Return a change of the law as one of the joints of this kind; its numbers bear the kind's name."""

        def act(setup: Setup, values: Array) -> Setup:
            return replace(
                setup, kinds={**setup.kinds, self.name: change.act(setup.kinds[self.name], values)}
            )

        names = {
            name: f"{name} of {self.name}" if several else name for name in {*change.names, *change.units}
        }
        return replace(
            change, way=f"{self.name}: {change.way}", act=act, names=tuple(names[name] for name in change.names),
            units={names[name]: unit for name, unit in change.units.items()}, kind=self.name,
        )  # fmt: skip

    def whole(self, numbers: Mapping[str, float], after: JointModel, found: Sequence[Change]) -> JointModel:
        """Return the model with what the changes of such joints have added, of the law's numbers of a setup."""
        own = [
            replace(change, way=change.way.removeprefix(f"{self.name}: "))
            for change in found
            if change.kind == self.name
        ]
        return assemble_model(numbers, self.laws, after, own)


def kinds_of(test: RigTest, models: Mapping[str, JointModel], least: float) -> tuple[JointKind, ...]:
    """Return the kinds of joints of a test, each with its model.

    Raises
    ------
    InputError
        Where a kind has no model.
    """
    names = tuple(dict.fromkeys(test.kinds))
    missing = sorted(set(names) - models.keys())
    if missing:
        raise InputError(
            f"no model of {missing[0]!r}; every kind of joint needs one: {', '.join(sorted(names))}"
        )
    return tuple(
        JointKind.of(
            name, tuple(np.flatnonzero([kind == name for kind in test.kinds]).tolist()), models[name], least
        )
        for name in names
    )


def with_slopes(
    assembled: Callable[[Array], JointModel], x: Array, high: Array, covariance: Array
) -> JointModel:
    """Return the model of some numbers of a fit with the covariance that follows from theirs, by linearisation."""
    whole = assembled(x)
    slopes = differences(
        lambda at: assembled(at).numbers, x, whole.numbers, range(x.size), np.full(x.size, DIFFERENCE), high
    )
    spread = slopes @ covariance @ slopes.T
    return whole.with_numbers(whole.numbers, (spread + spread.T) / 2)


def assemble_model(
    numbers: Mapping[str, float], laws: JointLaws, after: JointModel, changes: Sequence[Change]
) -> JointModel:
    """Return the whole model of a law's numbers with what changes have added; its errors are not yet known."""
    additions = [(change, laws.additions[change.way]) for change in changes if change.way in laws.additions]
    replacing = [each for _, each in additions if each.replaces]
    kept = [term for term in after.terms if not (term.id == FRICTION and replacing)]
    terms = [replace(t, coefficient=numbers.get(place_of(t.id), t.coefficient)) for t in kept]
    elements = list(after.elements)
    for change, addition in additions:
        names = [f"c{k}" for k in range(len(addition.variant.columns))]
        coefficients = [numbers.get(addition.name(name), 0.0) for name in names]
        if addition.replaces:
            # It carries the friction: its column comes to `level` under steady slip.
            friction = numbers[place_of(FRICTION)] / len(replacing)
            coefficients = [friction / numbers[addition.name("level")]]
        values = [numbers[addition.name(name)] for name in addition.variant.names]
        added = FittedEffect(change.effect, addition.variant, np.array(values), np.array(coefficients), 0.0)
        if addition.variant.states:
            elements.append(added.element())
        else:
            terms += added.terms()
    return replace(after, terms=tuple(terms), elements=tuple(elements), covariance=())
