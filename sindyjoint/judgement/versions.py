"""The versions of what computes here, for models and reports."""

from __future__ import annotations

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version

PACKAGES = ("sindyjoint", "pysindy", "scikit-learn", "numpy", "scipy", "matplotlib", "sympy", "numba")


@cache
def versions() -> tuple[tuple[str, str], ...]:
    """Return the versions of this package, of Python and of what it computes with."""
    found = [("Python", platform.python_version())]
    for name in PACKAGES:
        try:
            found.append((name, version(name)))
        except PackageNotFoundError:
            continue
    return tuple(found)
