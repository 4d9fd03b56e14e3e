"""A joint model read from the file that a discovery leaves."""

from __future__ import annotations

import os
from pathlib import Path

from sindyjoint.checksums import read_json
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.model_checks import check_model
from sindyjoint.errors import InputError, MissingInputError


def as_model(model: JointModel | str | os.PathLike[str]) -> JointModel:
    """Return a model as it is given, or that of a file."""
    return model if isinstance(model, JointModel) else read_model(model)


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
        within = [str(folder) for folder in _model_folders(Path(path))]
        raise MissingInputError(
            f"{str(path)!r}: no model is here; expected a model.json, or a folder with one, "
            + (f"such as {' or '.join(within)}" if within else "as 'discover --out' writes it")
        )
    data = read_json(file)
    try:
        model = JointModel.from_dict(data)
        check_model(model)
    except (ValueError, AttributeError) as error:
        reason = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
        raise InputError(f"{file}: {reason}") from error
    return model


def read_models(path: str | os.PathLike[str]) -> list[JointModel]:
    """Read the model of a file or folder, or those of all kinds of joint in what ``discover RIG --out`` wrote.

    Raises
    ------
    MissingInputError, InputError
        As :func:`read_model`.
    """
    folder = Path(path)
    within = [] if (folder / "model.json").is_file() else _model_folders(folder)
    return [read_model(each) for each in within or [folder]]


def _model_folders(folder: Path) -> list[Path]:
    return sorted(file.parent for file in folder.glob("*/model.json")) if folder.is_dir() else []
