"""Limits that decide an answer, as data: each folder keeps one frozen record of them, every field explained.

Constants of numerics stay where they are used; what is here can be read with ``--verbose`` and in the guide.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any


@dataclass(frozen=True)
class Limit:
    """One limit of a policy.

    Parameters
    ----------
    name : str
    value : object
    meaning : str
        What is decided by it.
    unit : str
        ``"1"`` for a pure number.
    source : str
        Where the value comes from: a publication, a calibration, a convention.
    """

    name: str
    value: Any
    meaning: str
    unit: str
    source: str


def limit(value: Any, meaning: str, *, source: str, unit: str = "1") -> Any:
    """Return a field of a policy, with what explains it.

    Examples
    --------
    >>> @dataclass(frozen=True)
    ... class Policy:
    ...     belief: float = limit(0.9, "least probability of a name", source="convention")
    >>> described(Policy())
    (Limit(name='belief', value=0.9, meaning='least probability of a name', unit='1', source='convention'),)
    """
    return field(default=value, metadata={"meaning": meaning, "unit": unit, "source": source})


def described(policy: Any) -> tuple[Limit, ...]:
    """Return the limits of a policy in their order."""
    return tuple(Limit(f.name, getattr(policy, f.name), **f.metadata) for f in fields(policy))
