"""Results written to a folder, whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sindyjoint.errors import InputError
from sindyjoint.files.atomic import output_folder
from sindyjoint.reporting.places import PAGE, link_pages, place_of
from sindyjoint.reporting.registry import draw_all, view_of, view_of_type
from sindyjoint.reporting.saved import DATA_FILE, saved_text

if TYPE_CHECKING:
    from sindyjoint.judgement.discovery import Discovery


def write_results(
    result: Any,
    folder: str | os.PathLike[str],
    command_line: str | Sequence[str] | None = None,
    seed: object = None,
    files: Sequence[str | os.PathLike[str]] = (),
    force: bool = False,
) -> Path:
    """Write the page, the record, the figures and the further files of a result, all of them or none.

    Earlier results of the same kind are replaced, all of their files; of another kind, they stay where they are, and
    these go into a folder of their own within: ``results/diagnosis``.

    Parameters
    ----------
    result : Discovery, Verification, Diagnosis, Comparison, Batch, Reproduction or RigMotion
    folder : path
        Made if it does not exist. After an error everything is as before.
    command_line, seed, files
        For the page's last section; see :func:`sindyjoint.reporting.provenance.provenance`.
    force : bool
        Replace files of the same names that are no such results, or were changed since.

    Returns
    -------
    Path
        The folder that they stand in.

    Raises
    ------
    OutputError
        If the folder cannot be written, or holds other files of these names.
    """
    view, name = view_of(result), view_of_type(result).folder
    target = place_of(name, folder)
    data = view.gather(result)
    pictures = draw_all(data)
    texts = {
        DATA_FILE: saved_text(data),
        PAGE: view.page(result, data, view.origin(result, command_line, seed, files), pictures, target),
        **view.files(result, data),
    }
    if view.record_file:
        texts[view.record_file] = json_text(view.to_dict(result))
    write_folder(target, pictures, texts, name, force)
    link_pages(Path(folder))
    return target


write_discovery = write_results


def write_folder(
    folder: str | os.PathLike[str],
    pictures: Mapping[str, bytes],
    texts: Mapping[str, str],
    kind: str = "",
    force: bool = False,
) -> Path:
    """Write pictures into ``figures`` and texts by their names, all of them or none.

    Parameters
    ----------
    folder : path
        Made if it does not exist. After an error everything is as before.
    pictures : mapping of str to bytes
        SVG by kind of figure.
    texts : mapping of str to str
        Text by name of file.
    kind, force
        See :func:`sindyjoint.files.atomic.output_folder`.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    with output_folder(folder, kind, force=force) as stage:
        (stage / "figures").mkdir()
        for kind, svg in pictures.items():
            (stage / "figures" / f"{kind}.svg").write_bytes(svg)
        for name, text in texts.items():
            # Of a path that is no UTF-8 the page shows the bytes, as JSON writes them.
            (stage / name).write_bytes(text.encode("utf-8", errors="backslashreplace"))
    return Path(folder)


def json_text(record: Any) -> str:
    """Return a record as the text of a file."""
    return json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


@dataclass(frozen=True)
class CampaignFiles:
    """Writes more about each campaign of a batch into its folder; for ``batch(write=...)``.

    Parameters
    ----------
    reports : bool
        What ``sindyjoint discover --out`` writes.
    diagnose : bool
        What ``sindyjoint diagnose --out`` writes, in the folder ``diagnosis``.
    """

    reports: bool = True
    diagnose: bool = False

    @property
    def extras(self) -> tuple[str, ...]:
        """Names of what is written."""
        return ("reports",) * self.reports + ("diagnosis",) * self.diagnose

    def __call__(self, result: Discovery, folder: Path) -> None:
        """Write what was asked for about a result."""
        if self.reports:
            # Over the model that the batch itself has put into the folder.
            write_results(result, folder, force=True)
        if self.diagnose and result.found:
            from sindyjoint.workflows.diagnose import diagnose

            try:
                # As it was read: what is left out of it is found, left out and said once more.
                campaign = result.measured or result.campaign
                write_results(
                    diagnose(campaign, result.model, accept=result.soundness.accepted), folder / "diagnosis"
                )
            except InputError as error:
                # The joint is discovered all the same.
                (folder / "diagnosis").mkdir(exist_ok=True)
                (folder / "diagnosis" / "impossible.txt").write_text(f"{error}\n", encoding="utf-8")
