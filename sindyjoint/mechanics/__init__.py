"""What makes motion: joint laws, excitations, exact stick–slip simulation, virtual tests and structures.

Nothing here knows how laws are discovered; a recovered law is simulated through the protocol of
:class:`sindyjoint.mechanics.laws.Law`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sindyjoint.mechanics.laws import INTER_PANEL, PANEL_ROOT, FunctionLaw, PaperLaw
    from sindyjoint.mechanics.pulse_test import with_laws
    from sindyjoint.mechanics.rig_test_file import load_rig_test
    from sindyjoint.mechanics.rigs import load_rig

__all__ = ["INTER_PANEL", "PANEL_ROOT", "FunctionLaw", "PaperLaw", "load_rig", "load_rig_test", "with_laws"]

# numba takes a second to import: only when something is simulated.
_HOMES = {
    "INTER_PANEL": "laws",
    "PANEL_ROOT": "laws",
    "FunctionLaw": "laws",
    "PaperLaw": "laws",
    "load_rig": "rigs",
    "load_rig_test": "rig_test_file",
    "with_laws": "pulse_test",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
