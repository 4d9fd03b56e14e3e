"""The bones of every report page: one HTML file that opens offline and asks nothing of the net."""

from __future__ import annotations

import base64
import hashlib
import math
import re
from collections.abc import Iterable
from functools import cache
from html import escape
from importlib import resources
from typing import TYPE_CHECKING, Any

from sindyjoint.reporting.style import INK, MUTED, RULE
from sindyjoint.text import spelled

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

# In the order in which they run; each is a separate file next to the templates.
SCRIPTS = ("page.js", "map3d.js", "loops.js")
# What the page's style sheet may repaint, so that one drawing serves light and dark.
_REPAINTED = {INK: "var(--ink)", MUTED: "var(--muted)", RULE: "var(--rule)"}


def render(template: str, **content: Any) -> str:
    """Return a page from a template with the style sheet and scripts put into it."""
    script = "\n".join(_text(name) for name in SCRIPTS)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return (
        _environment()
        .get_template(template)
        .render(css=markup(_text("style.css")), script=markup(script), script_hash=digest, **content)
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
    environment.filters["number"] = number
    environment.filters["spelled"] = spelled
    environment.filters["joined"] = _joined
    return environment


def number(value: float | None, digits: int = 3) -> str:
    """Return a number for a table; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{value:.{digits}g}".replace("-", "−")


@cache
def _text(name: str) -> str:
    return resources.files("sindyjoint.reporting").joinpath("templates", name).read_text(encoding="utf-8")


def _joined(identifiers: Iterable[str], motion: str = "rotation") -> str:
    """Return ids in words, separated by commas."""
    return ", ".join(spelled(identifier, motion) for identifier in identifiers)
