"""A joint model read from the file that a discovery leaves."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from sindyjoint.documents import read_json
from sindyjoint.equation.formula import VARIABLES, compile_terms, variable_symbols
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import read_test
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
        _check_model(model)
    except (ValueError, AttributeError) as error:
        reason = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
        raise InputError(f"{file}: {reason}") from error
    return model if model.test is not None else replace(model, test=read_test(file))


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


def _check_model(model: JointModel) -> None:
    """Refuse a model of which a term is beyond all measure within the range that it was fitted on.

    Raises
    ------
    InputError
        Naming the term.
    """
    fitted = model.fitted
    if not (fitted.moment_rms > 0 and fitted.angle > 0 and fitted.rate > 0):
        return
    acceleration = variable_symbols()[2]
    terms = [term for term in model.terms if acceleration not in term.expression.free_symbols]
    if not terms:
        return
    angle, rate = (a.ravel() for a in np.meshgrid(fitted.angle * np.array([-1, -0.5, 0.5, 1]),
                                                  fitted.rate * np.array([-1, -0.5, 0.5, 1])))  # fmt: skip
    with np.errstate(all="ignore"):
        far = {each.name: max(each.tested or (each.reference,), key=abs) for each in model.inputs}
        moments = compile_terms([term.expression for term in terms], (*VARIABLES, *far))(
            angle, rate, np.nan, *far.values()
        )
        moments = np.abs(moments * [term.coefficient for term in terms]).max(axis=0)
    for term, moment in zip(terms, moments, strict=True):
        # A term of a law that was measured stays near the measured moment; collinear terms may cancel, not to this
        # extent.
        if not moment <= 1e6 * fitted.moment_rms:
            raise InputError(
                f"term {term.id!r}: its coefficient {term.coefficient:g} makes {moment:.3g} within the tested range, "
                f"where {fitted.moment_rms:.3g} was measured; the file was changed or damaged"
            )
