"""Limits that decide an answer, as data: each folder keeps one frozen record of them, every field explained.

Constants of numerics stay where they are used; what is here can be read with ``--verbose`` and in the guide.
"""

from __future__ import annotations

import pkgutil
from dataclasses import dataclass, field, fields, is_dataclass
from importlib import import_module
from typing import Any

JUDGEMENT = "chosen by judgement"


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

    @property
    def quantity(self) -> str:
        """The value with its unit."""
        return f"{self.value}" if self.unit == "1" else f"{self.value} {self.unit}"


def limit(value: Any, meaning: str, *, source: str = JUDGEMENT, unit: str = "1") -> Any:
    """Return a field of a policy, with what explains it; without a source no calibration is recorded.

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


def policies(package: str = "sindyjoint") -> dict[str, Any]:
    """Return every policy of a package, by the folder whose ``policy.py`` holds it.

    A folder with one policy calls it ``POLICY``. Of a folder with several, each stands under the folder and its own
    name: ``"diagnosis structure"``.

    Returns
    -------
    dict of str to dataclass
        See :func:`sindyjoint.policy.described` for what each field says.
    """
    found = {}
    for part in pkgutil.walk_packages(import_module(package).__path__, f"{package}."):
        *folders, last = part.name.split(".")[1:]
        for name, record in vars(import_module(part.name)).items() if last == "policy" else ():
            if _is_policy(record):
                found[" ".join(folders if name == "POLICY" else [*folders, name.lower()])] = record
    return found


def _is_policy(record: Any) -> bool:
    return (
        is_dataclass(record)
        and not isinstance(record, type)
        and all({"meaning", "unit", "source"} <= set(field.metadata) for field in fields(record))
    )
