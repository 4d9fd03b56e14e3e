"""What lower layers call and higher ones supply: a record shows itself without importing what shows it.

The root of the package, which every import of a part of it runs first, says what stands behind each hook. Nothing here
or below knows a module above.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

_SUPPLIERS: dict[str, Callable[[], Any]] = {}


def supply(hook: str, load: Callable[[], Any]) -> None:
    """Say what stands behind a hook; it is loaded where it is used."""
    _SUPPLIERS[hook] = load


def supplied(hook: str) -> Any:
    """Return what stands behind a hook."""
    return _SUPPLIERS[hook]()
