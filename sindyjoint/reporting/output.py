"""Write the results of a discovery to a folder, whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

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
    with output_folder(folder) as stage:
        (stage / "figures").mkdir()
        pictures = draw_all(data)
        for kind, svg in pictures.items():
            (stage / "figures" / f"{kind}.svg").write_bytes(svg)
        _write(stage / DATA_FILE, saved_text(data))
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
