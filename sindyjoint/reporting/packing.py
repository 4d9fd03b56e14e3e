"""Records as plain JSON data, and back; and the JSON Schema of campaign.toml and of every result file."""

from __future__ import annotations

import math
import types
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from importlib import import_module
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import BaseModel

from sindyjoint.described import json_schema, scalar_of_array
from sindyjoint.errors import InputError, UnknownNameError

DIGITS = 6


def pack(value: Any, skip: Iterable[str] = ()) -> Any:
    """Return a value as plain JSON data: numbers to six digits, what is not finite as null.

    A class with both ``to_dict`` and ``from_dict`` writes and reads itself.

    Parameters
    ----------
    value : dataclass, ndarray, mapping, tuple, or plain value
    skip : iterable of str
        Fields to leave out of a dataclass.
    """
    if _writes_itself(type(value)):
        return value.to_dict()
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: pack(getattr(value, f.name)) for f in fields(value) if f.name not in skip}
    if isinstance(value, np.ndarray | np.generic):
        return pack(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): pack(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [pack(item) for item in value]
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
    return value


def unpack(kind: Any, data: Any, absent: Mapping[str, Any] = types.MappingProxyType({})) -> Any:
    """Return a dataclass from what :func:`pack` made of it.

    A field that is missing, as in a file of an earlier version, takes its default.

    Parameters
    ----------
    kind : type
        A dataclass whose fields are numbers, texts, arrays, tuples, mappings, or such dataclasses.
    data : mapping
    absent : mapping of str to object
        What to take for fields that were skipped.

    Raises
    ------
    InputError
        If a field is missing or of another shape.
    """
    if not isinstance(data, Mapping):
        raise InputError(
            f"not a saved {kind.__name__}: expected a table of fields, got {type(data).__name__}"
        )
    hints = get_type_hints(kind)
    read: dict[str, Any] = dict(absent)
    for field in fields(kind):
        if field.name in absent or (field.name not in data and _has_default(field)):
            continue
        if field.name not in data:
            raise InputError(f"not a saved {kind.__name__}: field {field.name!r} is missing")
        try:
            read[field.name] = _restore(hints[field.name], data[field.name])
        except InputError:
            raise
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError(f"not a saved {kind.__name__}: field {field.name!r}: {error}") from None
    return kind(**read)


def _has_default(field: Field[Any]) -> bool:
    return field.default is not MISSING or field.default_factory is not MISSING


def _writes_itself(kind: Any) -> bool:
    return hasattr(kind, "to_dict") and hasattr(kind, "from_dict")


def _restore(hint: Any, value: Any) -> Any:
    """Return a value of the type that a hint names."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (types.UnionType, Union):
        return _restore_one_of(arguments, value)
    if (scalar := scalar_of_array(hint)) is not None:
        return np.array(value, dtype=scalar)
    if origin is tuple:
        return _restore_tuple(arguments, value)
    if origin is dict:
        if not isinstance(value, Mapping):
            raise TypeError(f"expected a table, got {value!r:.40}")
        return {str(key): _restore(arguments[1], item) for key, item in value.items()}
    if _writes_itself(hint):
        return hint.from_dict(value)
    if is_dataclass(hint):
        return unpack(hint, value)
    if hint is float:
        return float("nan") if value is None else float(value)
    if hint in (str, int, bool) and (
        not isinstance(value, hint) or (hint is int and isinstance(value, bool))
    ):
        raise TypeError(f"expected {hint.__name__}, got {value!r:.40}")
    return value


def _restore_one_of(hints: tuple[Any, ...], value: Any) -> Any:
    """Return a value of the only one of several types that it can be: text, nothing, or the other one."""
    if value is None and type(None) in hints:
        return None
    if isinstance(value, str) and str in hints:
        return value
    others = [hint for hint in hints if hint not in (type(None), str)]
    if not others:
        raise TypeError(f"expected a text, got {value!r:.40}")
    return _restore(others[0], value)


def _restore_tuple(hints: tuple[Any, ...], value: Any) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise TypeError(f"expected a list, got {value!r:.40}")
    if len(hints) == 2 and hints[1] is Ellipsis:
        return tuple(_restore(hints[0], item) for item in value)
    if len(value) != len(hints):
        raise ValueError(f"expected {len(hints)} values, got {len(value)}")
    return tuple(_restore(hint, item) for hint, item in zip(hints, value, strict=True))


# Where the record of each stands; what reads a file is checked by pydantic, what is written describes itself.
_RECORDS = {
    "campaign": "files.manifest:Manifest",
    "model": "equation.model_record:ModelRecord",
    "test": "equation.test_record:TestRecord",
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
    return record.model_json_schema(by_alias=True) if issubclass(record, BaseModel) else json_schema(record)


def record_names() -> tuple[str, ...]:
    """Return the names of what has a schema."""
    return tuple(_RECORDS)
