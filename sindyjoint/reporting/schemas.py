"""The JSON Schema of every result file, by its name."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel

from sindyjoint.equation.model_record import ModelRecord
from sindyjoint.errors import UnknownNameError
from sindyjoint.files.manifest import Manifest
from sindyjoint.reporting.record_tables import (
    BatchRecord,
    ComparisonRecord,
    JointRecord,
    PrintedTablesRecord,
    ReproductionRecord,
)
from sindyjoint.reporting.records import (
    CheckRecord,
    DiagnosisRecord,
    DiscoveryRecord,
    ExportRecord,
    RigRecord,
    SimulationRecord,
    VerificationRecord,
)
from sindyjoint.response.nuisances import TestRecord


def record_schema(name: str) -> dict[str, Any]:
    """Return the JSON Schema of a result file.

    Parameters
    ----------
    name : str
        One of :func:`record_names`.

    Raises
    ------
    UnknownNameError
        For another name.
    """
    records = _records()
    if name not in records:
        raise UnknownNameError(f"schema of {name!r}; expected one of {', '.join(records)}")
    return records[name].model_json_schema(by_alias=True)


def record_names() -> tuple[str, ...]:
    """Return the names of result files that have a schema."""
    return tuple(_records())


def _records() -> dict[str, type[BaseModel]]:
    return {
        "campaign": Manifest,
        "model": ModelRecord,
        "test": TestRecord,
        "check": CheckRecord,
        "discovery": DiscoveryRecord,
        "comparison": ComparisonRecord,
        "verification": VerificationRecord,
        "diagnosis": DiagnosisRecord,
        "rig": RigRecord,
        "export": ExportRecord,
        "simulation": SimulationRecord,
        "batch": BatchRecord,
        "joint": JointRecord,
        "reproduction": ReproductionRecord,
        "tables": PrintedTablesRecord,
    }
