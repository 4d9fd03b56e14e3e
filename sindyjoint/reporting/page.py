"""The bones of every report page, one HTML file that opens offline, and where a result came from."""

from __future__ import annotations

import base64
import hashlib
import os
import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from html import escape
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.documents import hash_file, read_toml
from sindyjoint.equation.model_parts import versions
from sindyjoint.record import Campaign
from sindyjoint.reporting.equation import symbol_html
from sindyjoint.reporting.style import INK, MUTED, RULE
from sindyjoint.reporting.tables import TextTable, shown

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

    from sindyjoint.reporting.figure import Kind


@dataclass(frozen=True)
class Provenance:
    """What one needs to make a result again.

    Parameters
    ----------
    command_line : str
        Empty where the result was made from Python.
    seed : str
    made : str
        Date and time, UTC.
    versions : tuple of (str, str)
    inputs : tuple of (str, str, str)
        Run, file, SHA-256; the latter two empty for runs that come from no file.
    notes : tuple of str
    """

    command_line: str
    seed: str
    made: str
    versions: tuple[tuple[str, str], ...]
    inputs: tuple[tuple[str, str, str], ...]
    notes: tuple[str, ...] = ()


def provenance(
    campaign: Campaign | None = None,
    seed: object = None,
    command_line: str | Sequence[str] | None = None,
    files: Sequence[str | os.PathLike[str]] = (),
) -> Provenance:
    """Return the provenance of a result that is made now.

    Parameters
    ----------
    campaign : Campaign, optional
        Its runs name the files that they come from.
    seed : object
    command_line : str or sequence of str, optional
    files : sequence of path
        Further files that were read, such as a model or a rig; folders stand for the manifest or model in them.
    """
    return Provenance(
        command_line=command_line if isinstance(command_line, str) else shlex.join(command_line or ()),
        seed="none given"
        if seed is None
        else str(seed)
        if isinstance(seed, int | np.integer)
        else "a generator of the caller's",
        made=f"{str(np.datetime64('now', 's')).replace('T', ' ')} UTC",
        versions=versions(),
        # A run that a file names, too, stands once.
        inputs=tuple(
            dict.fromkeys(
                [
                    *(
                        (
                            run.name,
                            run.source.path if run.source else "",
                            run.source.sha256 if run.source else "",
                        )
                        for run in (campaign.runs if campaign else ())
                    ),
                    *(entry for file in files for entry in _hashed(Path(file))),
                ]
            )
        ),
        notes=campaign.notes if campaign else (),
    )


def _hashed(path: Path) -> list[tuple[str, str, str]]:
    """Return stem, name and SHA-256 of a file; of a campaign's manifest, of its run files too."""
    if path.is_dir():
        path = next(
            (path / name for name in ("campaign.toml", "rig.toml", "model.json") if (path / name).is_file()),
            path,
        )
    if not path.is_file():
        return []
    listed = [path]
    if path.suffix == ".toml":
        for run in read_toml(path).get("run", []):
            if isinstance(run, dict) and "file" in run:
                exact = path.parent / run["file"]
                listed += [exact] if exact.is_file() else sorted(path.parent.glob(run["file"]))
    return [(one.stem, one.name, hash_file(one)) for one in listed if one.is_file()]


# In the order in which they run; each is a separate file next to the templates.
SCRIPTS = ("page.js", "map3d.js", "loops.js")
# What the page's style sheet may repaint, so that one drawing serves light and dark.
_REPAINTED = {INK: "var(--ink)", MUTED: "var(--muted)", RULE: "var(--rule)"}


# Id, heading, link and blocks of a section of a page.
Section = dict[str, Any]


def section(id: str, heading: str, link: str, *blocks: str) -> Section:
    """Return a part of a page of blocks that :class:`Blocks` makes; empty ones are left out."""
    return {
        "id": id,
        "heading": heading,
        "link": link,
        "blocks": [block for block in blocks if block and block.strip()],
    }


@dataclass(frozen=True)
class Page:
    """What a page says: of what kind, of whom, first of all, and part by part.

    Parameters
    ----------
    title, kicker, name : str
        Of the window, above the heading, and the heading.
    hero : str
        Picture beside the answers.
    found : sequence of str
        Blocks that answer the question of the page.
    lead : sequence of str
        Further blocks of the first screen; ``first`` stand above the answers.
    sections : sequence of Section
    payload : dict
        What its drawings need.
    """

    title: str
    kicker: str
    name: str
    hero: str
    found: Sequence[str]
    lead: Sequence[str]
    sections: Sequence[Section]
    payload: Mapping[str, Any] = field(default_factory=dict)
    first: Sequence[str] = ()


class Blocks:
    """What a page is made of, each block as HTML: the macros of ``blocks.html.j2``, and pictures by their names.

    Parameters
    ----------
    kinds : mapping of str to Kind
    pictures : mapping of str to bytes
        SVG of what is drawn, by kind.
    panel : callable
        Name of a figure and number of a panel → that as an SVG, and whether it is all of the figure.
    folder : Path, optional
        Where the page will stand.
    """

    def __init__(
        self,
        kinds: Mapping[str, Kind],
        pictures: Mapping[str, bytes],
        panel: Callable[[str, int], tuple[bytes, bool]] = lambda name, place: (b"", False),
        folder: Path | None = None,
    ):
        self.folder = folder
        self._kinds, self._pictures, self._panel = kinds, dict(pictures), panel

    def __getattr__(self, name: str) -> Callable[..., str]:
        return getattr(_environment().get_template("blocks.html.j2").module, name)

    def tables(self, *tables: TextTable) -> str:
        """Return the tables that have rows."""
        return join(self.table(table) for table in tables if table.rows)

    def pictures(self, *names: str) -> str:
        """Return the figures of these names, or all, that are drawn and do not yet stand on the page."""
        here = [name for name in names or tuple(self._pictures) if name in self._pictures]
        return join(self._figure(name, name, self._pictures[name]) for name in here)

    def hero(self, name: str, place: int = 0, caption: str = "", again: bool = False) -> str:
        """Return a panel of a figure for the first screen; one that is all of it stands below only ``again``."""
        if name not in self._pictures:
            return ""
        svg, whole = self._panel(name, place)
        if whole and not again:
            del self._pictures[name]
        return self._figure("lead", name, svg, caption) if svg else ""

    def _figure(self, id: str, name: str, svg: bytes, caption: str = "") -> str:
        kind = self._kinds[name]
        return self.picture(markup(inline_svg(svg, id, kind.title)), id, caption or kind.caption)

    def warnings(self, texts: Sequence[str], heading: str = "To be aware of") -> str:
        """Return sentences to be aware of."""
        return self.items(list(map(sentence, texts)), heading, "warnings")


def sentence(text: str) -> str:
    """Return words as a sentence: with a capital and a full stop."""
    return f"{capital(text)}." if text else ""


def capital(text: str) -> str:
    """Return words with a capital; an id, a symbol or the name of a file is written as it is: k_m is not K_m."""
    return text[:1].upper() + text[1:] if re.match(r"[^\W\d_]+(?![\w.])", text) else text


def join(blocks: Iterable[str]) -> str:
    """Return blocks as one."""
    return markup("\n").join(blocks)


def render(page: Page, origin: Provenance, simulated: bool) -> str:
    """Return a page as one HTML text, with the style sheet and scripts put into it."""
    script = "\n".join(map(_text, SCRIPTS))
    return (
        _environment()
        .get_template("page.html.j2")
        .render(
            page=page,
            sections=[part for part in page.sections if part["blocks"]],
            origin=origin,
            simulated=simulated,
            css=markup(_text("style.css")),
            script=markup(script),
            script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        )
    )


def markup(text: str) -> Markup:
    """Mark text that we made as HTML."""
    from markupsafe import Markup

    return Markup(text)


def inline_svg(svg: bytes, kind: str, title: str) -> str:
    """Return an SVG to stand within a page: with unique names of its parts, colours from the page's style sheet."""
    text = svg.decode()
    text = text[text.index("<svg") :]
    # matplotlib repeats every text in a comment; what a person wrote has no business there.
    text = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->\s*", "", text, flags=re.DOTALL)
    text = re.sub(r'\b(id|xlink:href|href)="(#?)([^":]+)"', rf'\1="\g<2>{kind}-\3"', text)
    text = re.sub(r"url\(#([^)]+)\)", rf"url(#{kind}-\1)", text)
    for colour, variable in _REPAINTED.items():
        text = text.replace(colour, variable)
    # The sheet on which matplotlib draws, once for the figure and once for each panel.
    text = text.replace("fill: #ffffff", "fill: none")
    width = re.search(r'width="([\d.]+)pt"', text)
    inches = float(width[1]) / 72 if width else 7.0
    opening = f'<svg role="img" aria-label="{escape(title)}" style="--wide: {inches:.3g}" '
    return text.replace("<svg ", opening, 1)


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("sindyjoint.reporting"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["symbol"] = lambda text: markup(symbol_html(text))
    return environment


def number(value: float | None, digits: int = 3) -> str:
    """Return a number for a table; a dash where there is none."""
    return shown(f"{{:.{digits}g}}", value).replace("-", "−")


@cache
def _text(name: str) -> str:
    return resources.files("sindyjoint.reporting").joinpath("templates", name).read_text(encoding="utf-8")
