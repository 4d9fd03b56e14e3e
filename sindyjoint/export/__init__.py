"""Joint models written for the tools in which structures and controllers are modelled: one function per target.

The contract of all targets: files, and a fidelity table that says what they carry and how well. An exporter says of
every term and every element how it is represented and what moment the represented form gives over a set of test cycles;
the table compares that with the model.
"""

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from sindyjoint.described import Described, same
from sindyjoint.documents import refuse_foreign_file
from sindyjoint.equation.catalogue_file import read_model
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import UnknownNameError, nearest, refuse
from sindyjoint.export.fidelity import ALL_TERMS, Cycles, Fidelity, not_carried, shares
from sindyjoint.files.atomic import output_folder, write_bytes
from sindyjoint.hooks import fetched
from sindyjoint.inputs import Input
from sindyjoint.numeric import Array

__all__ = ["TARGETS", "Export", "Fidelity", "export_model", "read_model", "write_export"]

__getattr__ = fetched(
    __name__,
    {
        "documents": "batch_samples",
        "elements": "BoucWen Gap LuGre Maxwell Slider kind_of",
        "fidelity": "ALL_TERMS Cycles Represented fidelity_table",
        "finite_elements": "field read_field",
        "parts": "Parts softening_limits",
    },
)

TARGETS = {
    "ansys": "APDL: COMBIN39, COMBIN40 and COMBIN37 elements, and a rig of beams around them",
    "abaqus": "connector behaviour: elasticity, damping, friction",
    "nastran": "CBUSH with PBUSHT, CBUSH1D with PBUSH1D, and tables",
    "simscape": "MATLAB script for spring, damper and friction blocks; a custom component for elements",
    "opensees": "a Python function: zeroLength element with materials in parallel",
    "mujoco": "MJCF: a hinge or slide joint, tendons and actuators for elements",
    "fmu": "FMI 2.0 co-simulation unit",
    "python": "a module that needs nothing else, with stick-slip steps",
    "c": "a C99 header, with stick-slip steps",
    "latex": "equation and table of the terms",
    "json": "the model with its fidelity table",
    "samples": "sets of coefficients as CSV, for Monte Carlo: of one joint, or of the joints of a batch",
}
# Where the function of a target stands; of others it is ``export`` of the module of the same name.
HOMES = {
    "abaqus": ("finite_elements", "export_abaqus"),
    "nastran": ("finite_elements", "export_nastran"),
    "opensees": ("finite_elements", "export_opensees"),
    "python": ("programs", "export_python"),
    "simscape": ("programs", "export_simscape"),
    "fmu": ("programs", "export_fmu"),
    "c": ("code", "export_c"),
    "latex": ("documents", "export_latex"),
    "json": ("documents", "export_json"),
    "samples": ("documents", "export_samples"),
}
TABLE = "lookup.csv"
# What writes formulas carries inputs, too, and code takes them as parameters.
WITH_INPUTS = ("json", "latex", "samples", "python", "c", "fmu")


@dataclass(frozen=True)
class Export(Described):
    """A model written for a target.

    Parameters
    ----------
    target : str
    files : mapping of str to (str or bytes)
        Content by file name.
    fidelity : tuple of Fidelity
    notes : tuple of str
        What a user of the files has to know.
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {"target": "target", "files": "names", **same("fidelity", "not_carried", "notes")}
    target: str
    files: Mapping[str, str | bytes]
    fidelity: tuple[Fidelity, ...]
    notes: tuple[str, ...] = ()

    @property
    def not_carried(self) -> tuple[str, ...]:
        """One sentence for each thing that the target cannot express."""
        return not_carried(self.fidelity)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the files."""
        return tuple(self.files)


def export_model(
    model: JointModel, target: str, at: Mapping[str, float] | None = None, **options: Any
) -> Export:
    """Write a model for a target.

    Parameters
    ----------
    model : JointModel
    target : str
        One of :data:`TARGETS`.
    at : mapping of str to float, optional
        Values of the law's inputs, SI; those not given are at their reference. Without it code takes inputs as
        parameters; ``"json"``, ``"latex"`` and ``"samples"`` write the dependence itself; the others are a folder of
        decks, one at each of some values over the tested ranges.
    **options
        Of the target: ``rig`` for "ansys", the name or path of the rig written around the joint.

    Returns
    -------
    Export

    Raises
    ------
    UnknownNameError
        For a target that nobody knows; the message names the nearest.
    InputError
        For a model that cannot be exported.
    MissingExtraError
        When the target needs a package that is not installed.

    Examples
    --------
    >>> export_model(None, "nastram")
    Traceback (most recent call last):
    ...
    sindyjoint.errors.UnknownNameError: target 'nastram' is not known; did you mean 'nastran'? Known are ...
    """
    if target not in TARGETS:
        known = f"Known are {', '.join(TARGETS)}"
        near = nearest(str(target).lower(), list(TARGETS), "")
        near = f"; {near} {known}" if near.endswith("?") else f"; {known}"
        raise UnknownNameError(f"target {target!r} is not known{near}")
    check_exportable(model)
    module, function = HOMES.get(target, (target, "export"))
    write: Callable[..., Export] = getattr(import_module(f"{__name__}.{module}"), function)
    used = model.used_inputs
    if used and not at and target not in WITH_INPUTS and all(each.levels > 1 for each in used):
        return _lookup(model, partial(write, **options))
    held = model.at(**(at or {})) if at or (used and target not in WITH_INPUTS) else model
    made = write(held, **options)
    return replace(made, fidelity=(*held_rows(model, held), *made.fidelity)) if held is not model else made


def _lookup(model: JointModel, write: Callable[[JointModel], Export]) -> Export:
    """Return the exports of a law held at values over the tested ranges of its inputs, and a table of them.

    Parameters
    ----------
    model : JointModel
        Whose inputs were tested over a range each.
    write : callable
        Writes a law without inputs.
    """
    inputs = model.used_inputs
    # Decks over the tested range of an input, where it is the only one, and where there are more.
    points = 5 if len(inputs) == 1 else 3
    nodes = {each.name: np.linspace(*(each.tested or (0.0, 0.0)), points) for each in inputs}
    table = [",".join([*(f"{each.name} [{each.shown_unit}]" for each in inputs), "folder"])]
    decks: dict[str, Export] = {}
    for values in product(*nodes.values()):
        shown = [each.shown(value) for each, value in zip(inputs, values, strict=True)]
        folder = "_".join(
            f"{each.name}_{re.sub(r'[^A-Za-z0-9.+-]', '', text)}"
            for each, text in zip(inputs, shown, strict=True)
        )
        decks[folder] = write(model.at(**dict(zip(nodes, map(float, values), strict=True))))
        table.append(",".join([*(text.split(" ")[0] for text in shown), folder]))
    files = {f"{folder}/{name}": text for folder, made in decks.items() for name, text in made.files.items()}
    first = next(iter(decks.values()))
    note = f"{TABLE} says which folder holds the joint at which {' and '.join(each.label for each in inputs)}"
    rows = [_between(model, each, nodes[each.name]) for each in inputs]
    # Of each term the row of the deck that carries it worst; all terms last.
    worst: dict[str, Fidelity] = {}
    for row in sorted(
        (row for made in decks.values() for row in made.fidelity), key=lambda row: row.term == ALL_TERMS
    ):
        worst[row.term] = max(worst.get(row.term, row), row, key=lambda row: (not row.carried, row.error))
    whole = files | {TABLE: "\n".join([*table, ""])}
    return Export(first.target, whole, (*rows, *worst.values()), (note, *first.notes))


def _between(model: JointModel, each: Input, nodes: Array) -> Fidelity:
    """Return the row of an input: what a straight line between decks misses of the law half way between them."""
    cycles = Cycles.of(model)
    alone = model.without_elements()

    def moments(values: Array) -> Array:
        return np.array([alone.moment(cycles.angle, cycles.rate, inputs={each.name: v}) for v in values])

    at = moments(nodes)
    missed = (at[1:] + at[:-1]) / 2 - moments((nodes[1:] + nodes[:-1]) / 2)
    words = f"lookup: {nodes.size} decks from {each.shown(nodes[0])} to {each.shown(nodes[-1])}, straight in between"
    worst = max(
        (shares(part[cycles.moving], model.fitted.moment_rms) for part in missed), key=lambda pair: pair[0]
    )
    return Fidelity(each.name, each.name, words, True, *worst)


def check_exportable(model: JointModel) -> None:
    """Refuse a model that no target can make use of.

    Raises
    ------
    InputError
        For a model without terms and elements, numbers that are not finite, or no tested range.
    """
    names = [f"coefficient of term {term.id!r}" for term in model.terms]
    names += [f"{number.name} of element {e.id!r}" for e in model.elements for number in e.numbers]
    known = {
        each.id: {"theta", "omega", *each.form.names, *(state.name for state in each.form.states)}
        for each in model.elements
    }
    others = {e.id: sorted({symbol.name for symbol in e.form.symbols} - known[e.id]) for e in model.elements}
    tested = [(name, getattr(model.fitted, name)) for name in ("angle", "rate", "moment_rms")]
    refuse(
        [
            (not names, "the model has no terms: nothing was found, so there is nothing to export"),
            *(
                (
                    not np.isfinite(value),
                    f"{name} of the model is {float(value)!r}; expected a finite number, as discover writes it",
                )
                for name, value in zip(names, model.numbers, strict=True)
            ),
            *(
                (
                    found,
                    f"element {id!r} of the model depends on {', '.join(found)}; expected formulas of angle, rate and "
                    "its own states, which are all that the targets know",
                )
                for id, found in others.items()
            ),
            *(
                (
                    not 0 < value < np.inf,
                    f"'fitted' of the model gives {name} = {value!r}; expected a positive number, as the tested range "
                    "is what an export is made for and judged on",
                )
                for name, value in tested
            ),
        ]
    )


def held_rows(model: JointModel, held: JointModel) -> tuple[Fidelity, ...]:
    """Return a row for each input that an export holds at a value: what the law misses at the ends of its range."""
    cycles, rows = Cycles.of(model), []
    alone, used = model.without_elements(), {each.name for each in model.used_inputs}
    at = {each.name: each.reference for each in held.inputs}
    whole = held.without_elements().moment(cycles.angle, cycles.rate)
    for each in (each for each in held.inputs if each.name in used):
        costs = [
            shares(
                (alone.moment(cycles.angle, cycles.rate, inputs=at | {each.name: end}) - whole)[
                    cycles.moving
                ],
                model.fitted.moment_rms,
            )
            for end in each.tested or ()
        ]
        words = f"not carried: held at {each.shown(each.reference)}"
        if each.tested:
            words += f", tested from {each.shown(each.tested[0])} to {each.shown(each.tested[1])}"
        rows.append(Fidelity(each.name, each.name, words, False, *max(costs, default=(0.0, 0.0))))
    return tuple(rows)


def write_export(export: Export, out: str | os.PathLike[str], force: bool = False) -> list[Path]:
    """Write the files of an export, all or none.

    Parameters
    ----------
    export : Export
    out : path
        A file for an export of one file, with the target's suffix where it has none; a folder for one of several, or
        for one file under its name when the folder exists.
    force : bool
        Replace files of a folder that were not written so, or were changed since, and a file that is no export.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    OutputError
        When the path cannot be written, or a folder holds other files of these names.
    """
    path = Path(out)
    data = {
        name: content.encode("utf-8") if isinstance(content, str) else content
        for name, content in export.files.items()
    }
    if len(data) == 1 and not path.is_dir():
        path = path if path.suffix else path.with_suffix(Path(next(iter(data))).suffix)
        refuse_foreign_file(path, force)
        return [write_bytes(path, *data.values())]
    with output_folder(path, force=force) as stage:
        for name, content in data.items():
            (stage / name).parent.mkdir(parents=True, exist_ok=True)
            (stage / name).write_bytes(content)
    return [path / name for name in data]
