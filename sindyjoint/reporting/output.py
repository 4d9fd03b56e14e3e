"""Write the results of a discovery to a folder, whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from sindyjoint.discovery.model import JointModel
from sindyjoint.errors import InputError, MissingInputError
from sindyjoint.files.atomic import output_folder
from sindyjoint.reporting.data import ReportData, gather
from sindyjoint.reporting.provenance import provenance
from sindyjoint.reporting.tables import terms_csv

if TYPE_CHECKING:
    from sindyjoint.workflows.discover import Discovery

T = TypeVar("T")

DATA_FILE = "figures/data.json"


def write_discovery(
    result: Discovery, folder: str | os.PathLike[str], command_line: str | Sequence[str] | None = None
) -> Path:
    """Write model.json, terms.csv, report.html and figures/*.svg.

    Parameters
    ----------
    result : Discovery
    folder : path
        Made if it does not exist. Files of the same names are replaced; after an error everything is as before.
    command_line : str or sequence of str, optional
        What was typed, for the report's last section.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    from sindyjoint.reporting.discovery_page import discovery_page

    # Drawn from what is saved, so that a figure drawn again later is the same to the last byte.
    data = ReportData.from_dict(gather(result).to_dict())
    origin = provenance(result.campaign, result.regressor.random_state, command_line)
    with output_folder(folder) as stage:
        (stage / "figures").mkdir()
        pictures = draw_all(data)
        for kind, svg in pictures.items():
            (stage / "figures" / f"{kind}.svg").write_bytes(svg)
        _write(stage / DATA_FILE, json.dumps(data.to_dict(), ensure_ascii=False, separators=(",", ":")))
        _write(stage / "model.json", result.model.to_json() + "\n")
        _write(stage / "terms.csv", terms_csv(result.model))
        _write(stage / "report.html", discovery_page(data, origin, pictures))
    return Path(folder)


def draw_all(data: ReportData) -> dict[str, bytes]:
    """Return every figure that the data can show, as SVG by kind."""
    from sindyjoint.reporting.figures import draw, drawable
    from sindyjoint.reporting.style import figure_bytes

    return {kind: figure_bytes(draw(kind, data), "svg") for kind in drawable(data)}


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")


def load_data(path: str | os.PathLike[str]) -> ReportData:
    """Return what :func:`write_discovery` saved for figures.

    Parameters
    ----------
    path : path
        The folder of results, or the ``model.json`` in it.

    Raises
    ------
    MissingInputError
        If there is no such folder or file, or it holds no data for figures.
    InputError
        If the data cannot be read, or belong to another model than the one that lies beside them.
    """
    given = Path(path)
    if not given.exists():
        raise MissingInputError(
            f"{str(given)!r} does not exist; the folder that --out of discover wrote is wanted"
        )
    folder = given if given.is_dir() else given.parent
    saved = folder / DATA_FILE
    if not saved.is_file():
        raise MissingInputError(
            f"{str(folder)!r} holds no {DATA_FILE}, from which figures are drawn; run discover again, with "
            "--out and the name of a folder"
        )
    data = _read(saved, ReportData.from_dict)
    model = _read(folder / "model.json", JointModel.from_dict)
    # As text: a noise floor that is not known is NaN, which equals nothing.
    if model.to_json() != data.model.to_json():
        raise InputError(
            f"{str(saved)!r} belongs to another model than {str(folder / 'model.json')!r}; run discover with --out "
            "again"
        )
    return data


def _read(path: Path, reader: Callable[[Any], T]) -> T:
    """Read a JSON file; errors name it."""
    try:
        return reader(json.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise MissingInputError(f"cannot read {str(path)!r}: {error.strerror or error}") from None
    except RecursionError:
        raise InputError(f"{str(path)!r}: nested too deeply to be a result") from None
    except ValueError as error:
        reason = str(error) if isinstance(error, InputError) else f"not JSON ({error})"
        raise InputError(f"{str(path)!r}: {reason}") from None
