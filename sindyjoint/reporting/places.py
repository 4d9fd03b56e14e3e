"""Results of several kinds in one folder: where each of them stands, and how their pages find each other."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path

from sindyjoint.documents import kind_of_results, read_checked
from sindyjoint.errors import InputError, OutputError
from sindyjoint.files.atomic import output_folder
from sindyjoint.reporting.registry import FOLDERS

PAGE = "report.html"
_LINKS = re.compile(r'<p class="beside">.*?</p>')


def place_of(name: str, folder: str | os.PathLike[str]) -> Path:
    """Return where results of a kind go: into the folder, or within where results of another kind came first.

    Raises
    ------
    OutputError
        For a batch, whose campaigns stand in the folder itself.
    """
    there = kind_of_results(Path(folder))
    if there in ("", name):
        return Path(folder)
    if name == "batch":
        raise OutputError(
            f"{str(folder)!r} holds the results of a {there}; choose another folder for a batch"
        )
    return Path(folder) / name


def list_places(folder: Path) -> dict[str, Path]:
    """Return the folder of each kind of result that one folder holds, that of its own first."""
    own = kind_of_results(folder)
    within = {
        name: folder / name for name in FOLDERS if name != own and kind_of_results(folder / name) == name
    }
    return {own: folder, **within} if own else within


def link_pages(folder: Path) -> None:
    """Name in every page of a folder the pages of other kinds that stand there too."""
    places = list_places(folder)
    for name, place in places.items():
        others = [
            f'<a href="{os.path.relpath(there / PAGE, place).replace(os.sep, "/")}">{other}</a>'
            for other, there in places.items()
            if other != name
        ]
        links = f'<p class="beside">{"Also here: " if others else ""}{", ".join(others)}</p>'
        # A page that was changed since is not ours.
        with suppress(InputError, OutputError, OSError):
            page = read_checked(place / PAGE).decode("utf-8")
            linked = _LINKS.sub(links, page, count=1)
            if linked != page:
                with output_folder(place, name, whole=False) as stage:
                    (stage / PAGE).write_bytes(linked.encode("utf-8"))
