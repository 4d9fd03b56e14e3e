"""The JSON Schema of campaign.toml and of every result file, by name."""

from __future__ import annotations

from functools import cache
from typing import Any

from pydantic import BaseModel

from sindyjoint.errors import UnknownNameError


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
    """Return the names of what has a schema."""
    return tuple(_records())


@cache
def _records() -> dict[str, type[BaseModel]]:
    from sindyjoint.equation.model_record import ModelRecord
    from sindyjoint.files.manifest import Manifest
    from sindyjoint.reporting.records import (
        batch,
        changed,
        check,
        comparison,
        curves,
        diagnosis,
        discovery,
        export,
        plan,
        reproduction,
        rig,
        structure,
        verification,
    )

    return {
        "campaign": Manifest,
        "model": ModelRecord,
        "plan": plan.PlanRecord,
        "check": check.CheckRecord,
        "discovery": discovery.DiscoveryRecord,
        "comparison": comparison.ComparisonRecord,
        "verification": verification.VerificationRecord,
        "diagnosis": diagnosis.DiagnosisRecord,
        "rig": rig.RigRecord,
        "joint-curves": curves.JointCurvesRecord,
        "structure-curves": curves.StructureCurvesRecord,
        "export": export.ExportRecord,
        "simulation": rig.SimulationRecord,
        "batch": batch.BatchRecord,
        "joint": batch.JointRecord,
        "changed": changed.ChangeRecord,
        "structure": structure.StructureRecord,
        "reproduction": reproduction.ReproductionRecord,
        "tables": reproduction.PrintedTablesRecord,
    }
