"""The policies of the package by name: every limit that decides an answer, found where its folder keeps it."""

from __future__ import annotations

import pkgutil
from dataclasses import fields, is_dataclass
from importlib import import_module
from types import ModuleType
from typing import Any


def policies(package: str = "sindyjoint") -> dict[str, Any]:
    """Return every policy of a package, by the folder whose ``policy.py`` holds it.

    A folder with one policy calls it ``POLICY``. Of a folder with several, each stands under the folder and its own
    name: ``"diagnosis structure"``.

    Returns
    -------
    dict of str to dataclass
        See :func:`sindyjoint.policy.described` for what each field says.
    """
    found = {}
    for module in _modules(import_module(package)):
        folder = module.__name__.split(".")[-2]
        for name, record in vars(module).items():
            if _is_policy(record):
                found[folder if name == "POLICY" else f"{folder} {name.lower()}"] = record
    return found


def _modules(package: ModuleType) -> list[ModuleType]:
    folders = (part.name for part in pkgutil.iter_modules(package.__path__) if part.ispkg)
    return [
        import_module(f"{package.__name__}.{folder}.policy")
        for folder in folders
        if any(
            part.name == "policy"
            for part in pkgutil.iter_modules(import_module(f"{package.__name__}.{folder}").__path__)
        )
    ]


def _is_policy(record: Any) -> bool:
    return (
        is_dataclass(record)
        and not isinstance(record, type)
        and all({"meaning", "unit", "source"} <= set(field.metadata) for field in fields(record))
    )
