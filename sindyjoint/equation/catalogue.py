"""Catalogues of candidate terms: what a joint's law may be made of.

A catalogue is a TOML file that people read, copy and edit; here it becomes frozen, checked objects. A term's
nonlinear parameters may be tied to the data ("a tenth of the largest rate"); :meth:`Catalogue.resolve` puts the
numbers in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sindyjoint.equation import formula
from sindyjoint.equation.catalogue_file import (
    Located,
    check_symbols,
    find_catalogue,
    gather_catalogue,
    library_folder,
    shipped_names,
)
from sindyjoint.equation.terms import (
    Parameter,
    Reference,
    ResolvedTerm,
    Term,
    input_units,
    term_columns,
)
from sindyjoint.errors import FormulaError, InputError, UnitError, UnknownNameError, nearest, refuse
from sindyjoint.inputs import check_name
from sindyjoint.limits import EQUATION

if TYPE_CHECKING:
    import sympy

    from sindyjoint.record import Motion

__all__ = [
    "Catalogue",
    "Parameter",
    "Reference",
    "ResolvedTerm",
    "Term",
    "as_catalogue",
    "library_folder",
    "list_catalogues",
    "load_catalogue",
    "term_columns",
]

DEFAULT = "extended"  # the catalogue of candidates where none is named


@dataclass(frozen=True, repr=False)
class Catalogue:
    """A named set of candidate terms.

    Parameters
    ----------
    name, description : str
    terms : tuple of Term
        Ids and symbols are unique.

    Examples
    --------
    >>> load_catalogue("paper").ids
    ('linear_stiffness', 'quadratic_stiffness', 'cubic_stiffness', 'linear_damping', 'coulomb_friction')
    """

    name: str
    description: str
    terms: tuple[Term, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "terms", tuple(self.terms))
        twice = sorted({term_id for term_id in self.ids if self.ids.count(term_id) > 1})
        if twice:
            raise InputError(
                f"library {self.name!r}: the id(s) {', '.join(twice)} are used twice; ids are unique"
            )
        check_symbols(f"library {self.name!r}", [(term.id, term.symbol) for term in self.terms])

    def __repr__(self) -> str:
        return f"Catalogue({self.name!r}, {len(self.terms)} terms)"

    def __len__(self) -> int:
        return len(self.terms)

    def __iter__(self) -> Iterator[Term]:
        return iter(self.terms)

    def __contains__(self, term_id: object) -> bool:
        return term_id in self._by_id

    def __getitem__(self, term_id: str) -> Term:
        try:
            return self._by_id[term_id]
        except KeyError:
            hint = nearest(str(term_id), self.ids, "it has")
            raise UnknownNameError(f"library {self.name!r} has no term {term_id!r}; {hint}") from None

    @cached_property
    def _by_id(self) -> dict[str, Term]:
        return {term.id: term for term in self.terms}

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the terms, in order."""
        return tuple(term.id for term in self.terms)

    def select(self, ids: Sequence[str]) -> Catalogue:
        """Return the catalogue of these terms, in this order; UnknownNameError names one it lacks."""
        return Catalogue(self.name, self.description, tuple(self[term_id] for term_id in ids))

    def without(self, ids: Sequence[str]) -> Catalogue:
        """Return the catalogue less these terms; UnknownNameError names one it lacks."""
        leaving = {self[term_id].id for term_id in ids}
        return Catalogue(self.name, self.description, tuple(term for term in self if term.id not in leaving))

    def union(self, *others: Catalogue) -> Catalogue:
        """Return one catalogue of all terms, each once, in order of first appearance.

        Raises
        ------
        InputError
            If two different terms share an id or a symbol.
        """
        terms: dict[str, Term] = {}
        for catalogue in (self, *others):
            for term in catalogue:
                if terms.setdefault(term.id, term) != term:
                    raise InputError(
                        f"term {term.id!r} of library {catalogue.name!r} differs from the one already there; "
                        "rename one"
                    )
        names = dict.fromkeys(catalogue.name for catalogue in (self, *others))
        return Catalogue(
            " + ".join(names), self.description if len(names) == 1 else "combined", tuple(terms.values())
        )

    def resolve(self, reference: Reference | None = None) -> tuple[ResolvedTerm, ...]:
        """Replace every nonlinear parameter by a number.

        Raises
        ------
        InputError
            If a parameter is relative to a scale that the reference does not give.
        """
        return tuple(term.resolve(reference) for term in self.terms)


def list_catalogues() -> tuple[Catalogue, ...]:
    """Return what ships with the package, in alphabetical order, with formulas as they are written."""
    found = (gather_catalogue(library_folder() / f"{name}.toml") for name in shipped_names())
    return tuple(Catalogue(name, text, tuple(entry for entry, _ in terms)) for name, text, terms in found)


def load_catalogue(name_or_path: str | Path) -> Catalogue:
    """Load a catalogue.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a shipped one, or a TOML file.

    Raises
    ------
    UnknownNameError, MissingInputError
        If there is no such library or file.
    InputError, FormulaError, UnitError
        For a fault in the file; the message names file, term and field.

    Examples
    --------
    >>> import sindyjoint
    >>> sindyjoint.load_catalogue("paper").ids
    ('linear_stiffness', 'quadratic_stiffness', 'cubic_stiffness', 'linear_damping', 'coulomb_friction')
    """
    path = find_catalogue(name_or_path)
    return _read_shipped(path) if path.parent == library_folder() else _load(path)


def default_candidates(angle: float, motion: str) -> Catalogue:
    """Return the candidates for a joint that turns, or slides, by up to ``angle`` (rad or m).

    The catalogue ``"extended"``; and the moment of gravity, m·g·l·sin θ, where the joint turns so far that it differs
    from the powers of the angle.
    """
    extended = load_catalogue(DEFAULT)
    if motion != "rotation" or angle < EQUATION.visible_gravity:
        return extended
    return extended.union(load_catalogue("stiffness").select(["gravity_moment"]))


def as_catalogue(library: Any, part_of: Callable[[Any], Catalogue] | None = None) -> Catalogue:
    """Return one catalogue from a name, a path, a catalogue, or several of these, or of what ``part_of`` reads."""
    if isinstance(library, Catalogue):
        return library
    if isinstance(library, (str, Path)):
        return load_catalogue(library)
    parts = [*map(part_of or as_catalogue, library)]
    if not parts:
        raise InputError("an empty list of libraries given; expected at least one name, path or Catalogue")
    return parts[0].union(*parts[1:])


def _load(path: Path) -> Catalogue:
    name, description, terms = gather_catalogue(path)
    return Catalogue(name, description, tuple(map(_term, terms)))


# What ships stays as it is.
_read_shipped = cache(_load)


def _term(located: Located) -> Term:
    """Build a term from its entry: parse the formula, check units, bring them into rotational form.

    What ships is in that form, and is not checked anew by every process: the tests load a copy of it, which is.
    """
    entry, path = located
    where = f"{path.name}: term {entry.id!r}"
    try:
        inputs = entry.inputs
        _check_bounds(entry.parameters)
        for each in inputs:
            check_name(each.name)
        names = [*(p.name for p in entry.parameters), *(each.reference for each in inputs if each.reference)]
        if len(set(names)) < len(names):
            raise InputError(f"a parameter name is used twice among {', '.join(names)}")
        expression = formula.parse_formula(entry.formula, names, [each.name for each in inputs])
        _check_use(expression, [*names, *(each.name for each in inputs)])
        ships = path.parent == library_folder()
        motion = None if ships else _checked_motion(entry, expression)
        parameters = tuple(_parameter(parameter, motion) for parameter in entry.parameters)
    except (FormulaError, UnitError, InputError) as error:
        raise type(error)(f"{where}: {error}") from None
    unit = _rotational(entry.unit, motion)
    term = replace(entry, unit=unit, parameters=parameters, expression=expression)
    return replace(term, unit=term.unit_for("rotation")) if inputs and not ships else term


def _check_bounds(parameters: Sequence[Parameter]) -> None:
    ends = [[each.value if end is None else end for end in (each.lower, each.upper)] for each in parameters]
    refuse(
        (
            not 0 < low <= each.value <= high,
            f"parameters.{number}: expected 0 < lower <= value <= upper; given are {low:g}, {each.value:g}, {high:g}",
        )
        for number, (each, (low, high)) in enumerate(zip(parameters, ends, strict=True), 1)
    )


def _check_use(expression: sympy.Expr, names: list[str]) -> None:
    used = {str(symbol) for symbol in expression.free_symbols}
    unused = [name for name in names if name not in used]
    if unused:
        raise InputError(f"parameter {unused[0]!r} does not occur in the formula; use it or take it out")
    if expression == 0:
        raise FormulaError("the formula is zero whatever the motion; a term must depend on something or be 1")


def _checked_motion(entry: Term, expression: sympy.Expr) -> Motion:
    """Return the motion whose units the entry is written in, having checked that they fit the formula."""
    units = {parameter.name: parameter.unit for parameter in entry.parameters}
    units |= input_units(entry.inputs)
    for unit in (entry.unit, *units.values()):
        if not formula.is_coherent(unit):
            raise UnitError(
                f"unit {unit!r} is not made of m, kg, s, rad, N, K, Pa, V, A only; catalogues are in SI: "
                "scale the value instead"
            )
    faults: dict[Motion, str] = {}
    motions: tuple[Motion, Motion] = ("rotation", "translation")
    for motion in motions:
        try:
            wanted = formula.coefficient_unit(expression, units, motion)
        except UnitError as error:
            faults[motion] = str(error)
            continue
        if formula.same_dimension(entry.unit, wanted):
            return motion
        moment = formula.MOMENT_UNITS[motion]
        faults[motion] = f"unit {entry.unit!r} times {entry.formula} is not {moment}; expected {wanted}"
    # Report against the kind of motion that the author had in mind, as far as the letters show.
    texts = " ".join((entry.unit, *units.values()))
    raise UnitError(faults["rotation" if "rad" in texts or "N*m" in texts else "translation"])


def _parameter(entry: Parameter, motion: Motion | None) -> Parameter:
    if motion is not None and entry.relative_to is not None:
        scales = {**formula.VARIABLE_UNITS[motion], "moment": formula.MOMENT_UNITS[motion]}
        wanted = scales[{"angle": "theta", "rate": "omega"}.get(entry.relative_to, "moment")]
        if not formula.same_dimension(entry.unit, wanted):
            raise UnitError(
                f"parameter {entry.name!r} is relative to the {entry.relative_to} and has the unit "
                f"{entry.unit!r}; expected {wanted}"
            )
    return replace(entry, unit=_rotational(entry.unit, motion))


def _rotational(unit: str, motion: Motion | None) -> str:
    if motion is None:
        return unit
    if motion == "translation":
        return formula.unit_for(unit, "rotation")
    return formula.unit_text(formula.parse_unit(unit))
