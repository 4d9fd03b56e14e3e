"""Figures, tables and report pages."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sindyjoint.reporting.output import write_discovery
    from sindyjoint.reporting.tables import terms_csv, terms_table

__all__ = ["terms_csv", "terms_table", "write_discovery"]

_HOMES = {"terms_csv": "tables", "terms_table": "tables", "write_discovery": "output"}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'sindyjoint.reporting' has no attribute {name!r}")
    return getattr(import_module(f"sindyjoint.reporting.{_HOMES[name]}"), name)
