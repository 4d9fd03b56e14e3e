"""A joint model read from the file that a discovery leaves."""

from __future__ import annotations

import os
from pathlib import Path

from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, MissingInputError


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
            f"{str(path)!r}: no model is here; expected a model.json, or a folder with one, as "
            "'discover --out' writes it"
        )
    try:
        return JointModel.from_json(file.read_bytes().decode("utf-8-sig"))
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror or error})") from error
    except (ValueError, AttributeError, RecursionError) as error:
        text = (
            str(error)
            if isinstance(error, InputError)
            else f"not a joint model: {type(error).__name__}: {error}"
        )
        raise InputError(f"{file}: {text}") from error
