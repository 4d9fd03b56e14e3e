"""Results saved for drawing again: ``figures/data.json`` in every folder of results."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from sindyjoint.documents import LARGEST, kind_of_results, parse_json, read_checked
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.model_file import read_model
from sindyjoint.errors import InputError, MissingInputError, NothingToDrawError, SindyJointError
from sindyjoint.reporting.registry import FOLDERS, SAVED, view_of

T = TypeVar("T")

DATA_FILE = "figures/data.json"


def saved_text(result: Any) -> str:
    """Return what is saved of a result as the text of ``figures/data.json``."""
    view = view_of(result)
    return json.dumps(view.save(view.gather(result)), ensure_ascii=False, separators=(",", ":"))


def list_saved(path: str | os.PathLike[str]) -> dict[str, Path]:
    """Return the folders of results within a folder, that of its own first, by the names of their kinds.

    Parameters
    ----------
    path : path
        A folder that a command wrote with ``--out``, or the ``model.json`` in it.
    """
    folder = Path(path) if Path(path).is_dir() else Path(path).parent
    own = kind_of_results(folder)
    places = {own: folder, **{name: folder / name for name in FOLDERS if name != own}}
    return {name: place for name, place in places.items() if (place / DATA_FILE).is_file()}


def load_results(path: str | os.PathLike[str]) -> Any:
    """Return what a command saved for figures.

    Parameters
    ----------
    path : path
        The folder of results, or the ``model.json`` in it.

    Returns
    -------
    ReportData, Verification, Diagnosis, Comparison, Batch, ReproductionFigures or RigFigures

    Raises
    ------
    MissingInputError
        If there is no such folder or file, or it holds no data for figures.
    NothingToDrawError
        If the folder holds a model without data for figures.
    InputError
        If the data cannot be read, or belong to another model than the one in the same folder.
    """
    given = Path(path)
    if not given.exists():
        raise MissingInputError(
            f"{str(given)!r} does not exist; expected a folder that a command wrote with --out"
        )
    folder = given if given.is_dir() else given.parent
    saved = folder / DATA_FILE
    model_file = folder / "model.json"
    if not saved.is_file():
        message = (
            f"{str(folder)!r} holds no {DATA_FILE}, from which figures are drawn; run discover, compare, verify, "
            "diagnose or reproduce again, with --out and the name of a folder"
        )
        if model_file.is_file():
            read_model(model_file)  # that of a bare model is no fault, unless it cannot be read
            raise NothingToDrawError(message)
        raise MissingInputError(message)
    result = _read(saved, _from_record)
    if isinstance(getattr(result, "model", None), JointModel):
        model = read_model(model_file)
        # As text: a noise floor that is not known is NaN, which equals nothing.
        if model.to_json() != result.model.to_json():
            raise InputError(
                f"{str(saved)!r} belongs to another model than {str(model_file)!r}; run the command with --out again"
            )
    return result


@contextmanager
def drawing(path: str | os.PathLike[str]) -> Iterator[None]:
    """Say of data that were changed, so that their parts no longer fit together, whose they are.

    Raises
    ------
    InputError
        If drawing from what was read at a path fails within the block.
    """
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError, ValueError) as error:
        if isinstance(error, SindyJointError):
            raise
        raise InputError(
            f"the data for figures of {str(path)!r} do not fit together ({' '.join(str(error).split()):.80}); run the "
            "command with --out again"
        ) from error


def _from_record(record: Any) -> Any:
    kind = record.get("kind") if isinstance(record, dict) else None
    if not isinstance(kind, str) or kind not in SAVED:
        raise InputError(f"not a saved result: 'kind' is {kind!r}; expected one of {', '.join(SAVED)}")
    return SAVED[kind].restore(record)


def _read(path: Path, reader: Callable[[Any], T]) -> T:
    """Read a JSON file; errors name it."""
    try:
        return reader(parse_json(read_checked(path, LARGEST["JSON"]).decode("utf-8"), str(path)))
    except UnicodeDecodeError as error:
        raise InputError(f"{str(path)!r}: is not UTF-8 text (byte {error.start})") from None
    except InputError as error:
        text = str(error)
        raise InputError(text if str(path) in text else f"{str(path)!r}: {text}") from None
    # Whatever a part of a result makes of values that it never wrote.
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        if isinstance(error, SindyJointError):
            raise
        reason = f"{type(error).__name__}: {' '.join(str(error).split()):.80}"
        raise InputError(f"{str(path)!r}: is not a saved result ({reason}); run the command again") from None
