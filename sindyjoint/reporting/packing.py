"""Frozen records of arrays as plain JSON data, and back."""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np

from sindyjoint.errors import InputError

DIGITS = 6


def pack(value: Any, skip: tuple[str, ...] = ()) -> Any:
    """Return a value as plain JSON data: numbers to six digits, what is not finite as null.

    Parameters
    ----------
    value : dataclass, ndarray, tuple, or plain value
    skip : tuple of str
        Fields to leave out of a dataclass.
    """
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: pack(getattr(value, f.name)) for f in fields(value) if f.name not in skip}
    if isinstance(value, np.ndarray):
        return pack(value.tolist())
    if isinstance(value, list | tuple):
        return [pack(item) for item in value]
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
    return value


def unpack(kind: Any, data: Any, **special: Callable[[Any], Any]) -> Any:
    """Return a dataclass from what :func:`pack` made of it.

    Parameters
    ----------
    kind : type
        A dataclass whose fields are numbers, texts, arrays, tuples, or such dataclasses.
    data : mapping
    **special : callable
        How to read single fields.

    Raises
    ------
    InputError
        If a field is missing or of another shape.
    """
    if not isinstance(data, Mapping):
        raise InputError(
            f"not a saved {kind.__name__}: a table of fields is wanted, {type(data).__name__} was given"
        )
    hints = get_type_hints(kind)
    read: dict[str, Any] = {}
    for field in fields(kind):
        if field.name not in data:
            raise InputError(f"not a saved {kind.__name__}: field {field.name!r} is missing")
        reader = special.get(field.name)
        try:
            value = data[field.name]
            read[field.name] = reader(value) if reader else _restore(hints[field.name], value)
        except (TypeError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"not a saved {kind.__name__}: field {field.name!r}: {error}") from None
    return kind(**read)


def _restore(hint: Any, value: Any) -> Any:
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is types.UnionType:
        return None if value is None else _restore(next(a for a in arguments if a is not type(None)), value)
    if origin is np.ndarray:
        scalar = np.dtype(get_args(arguments[1])[0]) if len(arguments) > 1 else np.dtype(float)
        return np.array(value, dtype=scalar)
    if origin is tuple:
        if not isinstance(value, list):
            raise TypeError(f"a list is wanted, {value!r:.40} was given")
        return tuple(_restore(arguments[0], item) for item in value)
    if is_dataclass(hint):
        return unpack(hint, value)
    if hint is float:
        return float("nan") if value is None else float(value)
    if hint in (str, int) and not isinstance(value, hint):
        raise TypeError(f"{hint.__name__} is wanted, {value!r:.40} was given")
    return value
