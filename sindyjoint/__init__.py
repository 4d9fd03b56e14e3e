"""Discover the equation of a nonlinear joint from vibration tests, with evidence."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from sindyjoint.hooks import supply

if TYPE_CHECKING:
    from sindyjoint.discovery.estimator import JointRegressor
    from sindyjoint.discovery.library import TermLibrary
    from sindyjoint.discovery.long_tables import discover_rows
    from sindyjoint.discovery.optimizer import UniqueShareSTLSQ
    from sindyjoint.equation.catalogue import Catalogue, load_catalogue
    from sindyjoint.equation.model import JointModel
    from sindyjoint.errors import SindyJointError
    from sindyjoint.export import export_model
    from sindyjoint.files import load_campaign
    from sindyjoint.files.drafting.init import init
    from sindyjoint.files.writers import write_campaign
    from sindyjoint.mechanics import INTER_PANEL, PANEL_ROOT, FunctionLaw, PaperLaw
    from sindyjoint.mechanics.rig_test_file import load_rig_plan
    from sindyjoint.mechanics.rigs import Rig, load_rig
    from sindyjoint.mechanics.virtual import virtual_campaign
    from sindyjoint.mechanics.virtual_rig import hinges, virtual_rig_test, with_laws
    from sindyjoint.planning.plan import play
    from sindyjoint.record import Campaign, Joint, Run
    from sindyjoint.reporting.registry import draw, load_results
    from sindyjoint.reporting.style import figure_bytes
    from sindyjoint.response.laws import model_law
    from sindyjoint.states import campaign_states, force_states, regression_rows
    from sindyjoint.states.surface import fit_surface, force_state_map
    from sindyjoint.workflows.batch import batch
    from sindyjoint.workflows.check import check
    from sindyjoint.workflows.compare import changed, compare
    from sindyjoint.workflows.curves import curves
    from sindyjoint.workflows.diagnose import diagnose, diagnose_rig, diagnose_structure
    from sindyjoint.workflows.discover import discover, discover_rig
    from sindyjoint.workflows.plan import plan
    from sindyjoint.workflows.simulate import rig_motion, simulate
    from sindyjoint.workflows.verify import refine, verify

__version__ = "1.0.0"

__all__ = [
    "Campaign",
    "Catalogue",
    "FunctionLaw",
    "INTER_PANEL",
    "Joint",
    "JointModel",
    "JointRegressor",
    "PANEL_ROOT",
    "PaperLaw",
    "Rig",
    "Run",
    "SindyJointError",
    "TermLibrary",
    "UniqueShareSTLSQ",
    "batch",
    "campaign_states",
    "changed",
    "check",
    "compare",
    "curves",
    "diagnose",
    "diagnose_rig",
    "diagnose_structure",
    "discover",
    "discover_rig",
    "discover_rows",
    "draw",
    "export_model",
    "figure_bytes",
    "fit_surface",
    "force_state_map",
    "force_states",
    "hinges",
    "init",
    "load_campaign",
    "load_catalogue",
    "load_results",
    "load_rig",
    "load_rig_plan",
    "model_law",
    "plan",
    "play",
    "refine",
    "regression_rows",
    "rig_motion",
    "simulate",
    "verify",
    "virtual_campaign",
    "virtual_rig_test",
    "with_laws",
    "write_campaign",
]

# Importing pysindy and scikit-learn takes two seconds: each name is fetched where it is first used.
_HOMES = {
    "Campaign": "record",
    "Catalogue": "equation.catalogue",
    "FunctionLaw": "mechanics",
    "INTER_PANEL": "mechanics",
    "Joint": "record",
    "JointModel": "equation.model",
    "JointRegressor": "discovery.estimator",
    "PANEL_ROOT": "mechanics",
    "PaperLaw": "mechanics",
    "Rig": "mechanics.rigs",
    "Run": "record",
    "SindyJointError": "errors",
    "TermLibrary": "discovery.library",
    "UniqueShareSTLSQ": "discovery.optimizer",
    "batch": "workflows.batch",
    "campaign_states": "states",
    "changed": "workflows.compare",
    "check": "workflows.check",
    "compare": "workflows.compare",
    "curves": "workflows.curves",
    "diagnose": "workflows.diagnose",
    "diagnose_rig": "workflows.diagnose",
    "diagnose_structure": "workflows.diagnose",
    "discover": "workflows.discover",
    "discover_rig": "workflows.discover",
    "discover_rows": "discovery.long_tables",
    "draw": "reporting.registry",
    "export_model": "export",
    "figure_bytes": "reporting.style",
    "fit_surface": "states.surface",
    "force_state_map": "states.surface",
    "force_states": "states",
    "hinges": "mechanics.virtual_rig",
    "init": "files.drafting.init",
    "load_campaign": "files",
    "load_catalogue": "equation.catalogue",
    "load_results": "reporting.registry",
    "load_rig": "mechanics.rigs",
    "load_rig_plan": "mechanics.rig_test_file",
    "model_law": "response.laws",
    "plan": "workflows.plan",
    "play": "planning.plan",
    "refine": "workflows.verify",
    "regression_rows": "states.record",
    "rig_motion": "workflows.simulate",
    "simulate": "workflows.simulate",
    "verify": "workflows.verify",
    "virtual_campaign": "mechanics.virtual",
    "virtual_rig_test": "mechanics.virtual_rig",
    "with_laws": "mechanics.virtual_rig",
    "write_campaign": "files.writers",
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
