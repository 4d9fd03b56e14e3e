"""What lower layers call and higher ones supply, and what of a package is fetched only where it is asked for.

The root of the package, which every import of a part of it runs first, says what stands behind each hook. Nothing here
or below knows a module above.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

_SUPPLIERS: dict[str, Callable[[], Any]] = {}


def supply(hook: str, load: Callable[[], Any]) -> None:
    """Say what stands behind a hook; it is loaded where it is used."""
    _SUPPLIERS[hook] = load


def supplied(hook: str) -> Any:
    """Return what stands behind a hook."""
    return _SUPPLIERS[hook]()


def lazily(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """Return what gives a package the names of its modules, imported where a name is first asked for.

    ``modules`` lists the names of each with blanks between them.
    """
    homes = {name: module for module, names in modules.items() for name in names.split()}

    def fetch(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"{package}.{homes[name]}"), name)

    return fetch
