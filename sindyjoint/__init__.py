"""Discover the equation of a nonlinear joint from vibration tests, with evidence."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sindyjoint.discovery.estimator import JointRegressor
    from sindyjoint.discovery.library import TermLibrary
    from sindyjoint.discovery.optimizer import UniqueShareSTLSQ
    from sindyjoint.equation.model import JointModel
    from sindyjoint.files import load_campaign
    from sindyjoint.record import Campaign, Joint, Run
    from sindyjoint.workflows.check import check
    from sindyjoint.workflows.discover import discover

__version__ = "0.1.0"

__all__ = [
    "Campaign",
    "Joint",
    "JointModel",
    "JointRegressor",
    "Run",
    "TermLibrary",
    "UniqueShareSTLSQ",
    "check",
    "discover",
    "load_campaign",
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
    "check": "workflows.check",
    "discover": "workflows.discover",
    "load_campaign": "files",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'sindyjoint' has no attribute {name!r}")
    return getattr(import_module(f"sindyjoint.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
