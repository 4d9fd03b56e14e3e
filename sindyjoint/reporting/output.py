"""Results written to a folder, whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sindyjoint.files.atomic import output_folder
from sindyjoint.reporting.data import ReportData, gather
from sindyjoint.reporting.provenance import provenance
from sindyjoint.reporting.saved import DATA_FILE, saved_text
from sindyjoint.reporting.tables import terms_csv

if TYPE_CHECKING:
    from sindyjoint.workflows.discover import Discovery


def write_discovery(
    result: Discovery, folder: str | os.PathLike[str], command_line: str | Sequence[str] | None = None
) -> Path:
    """Write model.json, terms.csv, report.html and the figures.

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
    pictures = draw_all(data)
    texts = {
        DATA_FILE: saved_text(data),
        "model.json": result.model.to_json() + "\n",
        "terms.csv": terms_csv(result.model),
        "report.html": discovery_page(data, origin, pictures),
    }
    return write_folder(folder, pictures, texts)


def write_folder(
    folder: str | os.PathLike[str], pictures: Mapping[str, bytes], texts: Mapping[str, str]
) -> Path:
    """Write pictures into ``figures`` and texts by their names, all of them or none.

    Parameters
    ----------
    folder : path
        Made if it does not exist. Files of the same names are replaced; after an error everything is as before.
    pictures : mapping of str to bytes
        SVG by kind of figure.
    texts : mapping of str to str
        Text by name of file.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    with output_folder(folder) as stage:
        (stage / "figures").mkdir()
        for kind, svg in pictures.items():
            (stage / "figures" / f"{kind}.svg").write_bytes(svg)
        for name, text in texts.items():
            (stage / name).write_text(text, encoding="utf-8", newline="\n")
    return Path(folder)


def json_text(record: Any) -> str:
    """Return a record as the text of a file."""
    return json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def draw_all(result: Any) -> dict[str, bytes]:
    """Return every figure that a result can show, as SVG by kind."""
    from sindyjoint.reporting.figures import draw, drawable
    from sindyjoint.reporting.style import figure_bytes

    return {kind: figure_bytes(draw(kind, result), "svg") for kind in drawable(result)}
