"""Targets by name, and models from files."""

from __future__ import annotations

import os
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import Any

from sindyjoint.discovery.model import JointModel
from sindyjoint.errors import InputError, MissingInputError, UnknownNameError
from sindyjoint.export.base import Export, check_exportable

TARGETS = {
    "ansys": "APDL: COMBIN39, COMBIN40 and COMBIN37 elements, and a rig of beams around them",
    "abaqus": "connector behaviour: elasticity, damping, friction",
    "nastran": "CBUSH with PBUSHT, CBUSH1D with PBUSH1D, and tables",
    "simscape": "MATLAB script with the parameters of spring, damper and friction blocks",
    "fmu": "FMI 2.0 co-simulation unit",
    "python": "a module that needs nothing else, with stick-slip steps",
    "c": "a C99 header, with stick-slip steps",
    "latex": "equation and table of the terms",
    "json": "the model with its fidelity table",
}


def export_model(model: JointModel, target: str, **options: Any) -> Export:
    """Write a model for a target.

    Parameters
    ----------
    model : JointModel
    target : str
        One of :data:`TARGETS`.
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
    return import_module(f"sindyjoint.export.{target}").export(model, **options)


def read_model(path: str | os.PathLike[str]) -> JointModel:
    """Read a model from ``model.json``, or from a folder of results that holds one.

    Raises
    ------
    MissingInputError
        If there is none.
    InputError
        If the file is no joint model; the message names file and field.
    """
    file = Path(path)
    if file.is_dir():
        file = file / "model.json"
    if not file.is_file():
        raise MissingInputError(
            f"{str(path)!r}: no model is here; a model.json, or the folder that 'sindyjoint discover --out' wrote, "
            "is wanted"
        )
    try:
        return JointModel.from_json(file.read_bytes().decode("utf-8-sig"))
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from error
    except (ValueError, AttributeError, RecursionError) as error:
        text = (
            str(error)
            if isinstance(error, InputError)
            else f"not a joint model: {type(error).__name__}: {error}"
        )
        raise InputError(f"{file}: {text}") from error
