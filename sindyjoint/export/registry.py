"""Targets by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from difflib import get_close_matches
from functools import partial
from importlib import import_module
from typing import Any

from sindyjoint.equation.model import JointModel
from sindyjoint.errors import UnknownNameError
from sindyjoint.export.base import Export, check_exportable, held_rows
from sindyjoint.export.lookup import lookup

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


# What writes formulas carries inputs, too, and code takes them as parameters.
WITH_INPUTS = ("json", "latex", "samples", "python", "c", "fmu")


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
        near = get_close_matches(str(target).lower(), TARGETS, n=1, cutoff=0.5)
        hint = f"; did you mean {near[0]!r}?" if near else ";"
        raise UnknownNameError(f"target {target!r} is not known{hint} Known are {', '.join(TARGETS)}")
    check_exportable(model)
    write: Callable[..., Export] = import_module(f"sindyjoint.export.{target}").export
    used = model.used_inputs
    if used and not at and target not in WITH_INPUTS and all(each.levels > 1 for each in used):
        return lookup(model, partial(write, **options))
    held = model.at(**(at or {})) if at or (used and target not in WITH_INPUTS) else model
    made = write(held, **options)
    return replace(made, fidelity=(*held_rows(model, held), *made.fidelity)) if held is not model else made
