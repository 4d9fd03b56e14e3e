"""The JSON Schema of campaign.toml and of every result file."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from pydantic import BaseModel

from sindyjoint.described import json_schema
from sindyjoint.errors import UnknownNameError

# Where the record of each stands; a manifest is checked by pydantic, all others describe themselves.
_RECORDS = {
    "campaign": "files.manifest:Manifest",
    "model": "equation.model:JointModel",
    "test": "equation.test_record:TestNuisances",
    "plan": "planning.plan:Plan",
    "check": "soundness.check:Check",
    "discovery": "judgement.discovery:Discovery",
    "comparison": "judgement.comparison:Comparison",
    "verification": "workflows.verify:RefinedModel",
    "diagnosis": "diagnosis.result:Diagnosis",
    "rig": "workflows.simulate:RigMotion",
    "joint-curves": "substructure.joint_curves:JointCurves",
    "structure-curves": "substructure.forced:StructureCurves",
    "export": "export:Export",
    "simulation": "workflows.simulate:WrittenTest",
    "batch": "workflows.joints.summary:Batch",
    "joint": "workflows.joints.record:CampaignRecord",
    "changed": "judgement.changed:Change",
    "structure": "judgement.rig_discovery:RigDiscovery",
    "reproduction": "workflows.reproduce:Reproduction",
    "tables": "judgement.paper_tables:PrintedTables",
}


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
    if name not in _RECORDS:
        raise UnknownNameError(f"schema of {name!r}; expected one of {', '.join(_RECORDS)}")
    module, _, kind = _RECORDS[name].partition(":")
    record = getattr(import_module(f"sindyjoint.{module}"), kind)
    return record.model_json_schema() if issubclass(record, BaseModel) else json_schema(record)


def record_names() -> tuple[str, ...]:
    """Return the names of what has a schema."""
    return tuple(_RECORDS)
