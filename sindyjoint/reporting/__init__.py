"""What results show: one view for each kind, in one registry; figures, tables, pages, files."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sindyjoint.reporting.equation import terms_csv
    from sindyjoint.reporting.output import write_results
    from sindyjoint.reporting.registry import draw, drawable, load_results

__all__ = ["draw", "drawable", "load_results", "terms_csv", "write_results"]

_HOMES = {
    "draw": "registry",
    "drawable": "registry",
    "load_results": "registry",
    "terms_csv": "equation",
    "write_results": "output",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'sindyjoint.reporting' has no attribute {name!r}")
    return getattr(import_module(f"sindyjoint.reporting.{_HOMES[name]}"), name)
