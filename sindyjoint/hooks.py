"""What lower layers call and higher ones supply: a record shows itself without importing what shows it.

The root of the package, which every import of a part of it runs first, says what stands behind each hook. Nothing here
or below knows a module above.
"""

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


def fetched(package: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package: public names by the module that has them, imported where first used.

    Parameters
    ----------
    package : str
    homes : mapping of str to str
        Names, with blanks between them, by module.
    """
    home = {name: module for module, names in homes.items() for name in names.split()}

    def fetch(name: str) -> Any:
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"{package}.{home[name]}"), name)

    return fetch
