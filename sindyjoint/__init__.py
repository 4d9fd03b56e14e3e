"""Discover the equation of a nonlinear joint from vibration tests, with evidence."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from sindyjoint.hooks import supply

if TYPE_CHECKING:
    from sindyjoint.discovery.estimator import JointRegressor
    from sindyjoint.discovery.library import TermLibrary
    from sindyjoint.discovery.optimizer import UniqueShareSTLSQ
    from sindyjoint.equation.model import JointModel
    from sindyjoint.files import load_campaign
    from sindyjoint.files.drafting.init import init
    from sindyjoint.record import Campaign, Joint, Run
    from sindyjoint.workflows.check import check
    from sindyjoint.workflows.compare import changed, compare
    from sindyjoint.workflows.curves import curves
    from sindyjoint.workflows.diagnose import diagnose, diagnose_rig, diagnose_structure
    from sindyjoint.workflows.discover import discover, discover_rig
    from sindyjoint.workflows.plan import plan
    from sindyjoint.workflows.simulate import simulate
    from sindyjoint.workflows.verify import verify

__version__ = "0.1.0"

__all__ = [
    "Campaign",
    "Joint",
    "JointModel",
    "JointRegressor",
    "Run",
    "TermLibrary",
    "UniqueShareSTLSQ",
    "changed",
    "check",
    "compare",
    "curves",
    "diagnose",
    "diagnose_rig",
    "diagnose_structure",
    "discover",
    "discover_rig",
    "init",
    "load_campaign",
    "plan",
    "simulate",
    "verify",
]

# Importing pysindy and scikit-learn takes two seconds: each name is fetched where it is first used.
_HOMES = {
    "Campaign": "record",
    "Joint": "record",
    "Run": "record",
    "JointModel": "equation.model",
    "JointRegressor": "discovery.estimator",
    "TermLibrary": "discovery.library",
    "UniqueShareSTLSQ": "discovery.optimizer",
    "changed": "workflows.compare",
    "check": "workflows.check",
    "compare": "workflows.compare",
    "curves": "workflows.curves",
    "diagnose": "workflows.diagnose",
    "diagnose_rig": "workflows.diagnose",
    "diagnose_structure": "workflows.diagnose",
    "discover": "workflows.discover",
    "discover_rig": "workflows.discover",
    "init": "files.drafting.init",
    "plan": "workflows.plan",
    "simulate": "workflows.simulate",
    "verify": "workflows.verify",
    "load_campaign": "files",
}

# What the parts call without importing it.
supply("display", lambda: import_module("sindyjoint.reporting.output"))
supply("arrays", lambda: import_module("sindyjoint.files.arrays"))


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        # Only what a person would type has a near name; the import system asks for __path__ and its like.
        import difflib

        near = difflib.get_close_matches(name, __all__, n=1) if not name.startswith("_") else []
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise AttributeError(f"module 'sindyjoint' has no attribute {name!r}{hint}")
    return getattr(import_module(f"sindyjoint.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
