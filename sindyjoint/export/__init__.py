"""Joint models written for the tools in which structures and controllers are modelled: one file per target."""

from sindyjoint.export.base import Export, Fidelity, write_export
from sindyjoint.export.registry import TARGETS, export_model
from sindyjoint.workflows.model_file import read_model

__all__ = ["TARGETS", "Export", "Fidelity", "export_model", "read_model", "write_export"]
