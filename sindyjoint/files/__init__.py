"""The door: campaigns from files into SI units, and back."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sindyjoint.files.campaign import load_campaign
    from sindyjoint.files.manifest import manifest_schema
    from sindyjoint.files.writers import write_campaign

__all__ = ["load_campaign", "manifest_schema", "write_campaign"]

# pydantic and pint take half a second to import: only when a campaign is read.
_HOMES = {"load_campaign": "campaign", "manifest_schema": "manifest", "write_campaign": "writers"}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
