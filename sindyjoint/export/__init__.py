"""Joint models written for the tools in which structures and controllers are modelled: one file per target."""

from sindyjoint.equation.model_file import read_model
from sindyjoint.export.base import Export, Fidelity, write_export
from sindyjoint.export.registry import TARGETS, export_model

__all__ = ["TARGETS", "Export", "Fidelity", "export_model", "read_model", "write_export"]
