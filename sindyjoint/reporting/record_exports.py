"""JSON records of exports, of two tests of one joint, and of joints inside a structure."""

from __future__ import annotations

from typing import Literal

from sindyjoint.reporting.records import DiscoveryRecord, Known, Maybe, Part, Version

# ---- export


class FidelityPart(Part):
    """How the target holds a term; errors as shares of the RMS moment of the test."""

    term: str
    symbol: str
    representation: str
    carried: bool
    error: Maybe
    largest_error: Maybe


class ExportRecord(Part):
    """``export --json``: the files, and what the target does not hold."""

    schema_: Version
    target: str
    files: list[str]
    fidelity: list[FidelityPart]
    not_carried: list[str]
    notes: list[str]


# ---- two tests of one joint


class ShiftPart(Part):
    """A coefficient before and after, SI; ``change`` is relative to the value before."""

    id: str
    symbol: str
    name: str
    unit: str
    before: Maybe
    after: Maybe
    interval_before: tuple[Maybe, Maybe]
    interval_after: tuple[Maybe, Maybe]
    change: Maybe
    interval: tuple[Maybe, Maybe]
    p_value: Maybe
    answer: Literal[
        "changed", "changed within margin", "the same within margin", "cannot tell", "not compared"
    ]


class ChangeRecord(Part):
    """``changed --json`` and ``changed.json``."""

    schema_: Version
    joint: str
    before: str
    after: str
    changed: bool
    sentence: str
    margin: Known
    coefficients: list[ShiftPart]
    warnings: list[str]


# ---- joints inside a structure


class StructureLaw(Part):
    """What was found of the joints of one kind."""

    kind: str
    joints: list[str]
    found: bool
    reason: str
    alike: str
    discovery: DiscoveryRecord | None


class SeenPart(Part):
    """How well a joint is shown: rad (m); errors relative, of its strongest harmonic."""

    name: str
    largest_angle: Known
    angle_error: Known
    moment_error: Known
    together: list[str]


class SensorPart(Part):
    """By what factor the error of each joint's moment grows without a sensor; null: it is no longer determined."""

    name: str
    worth: list[Maybe]


class NumberPart(Part):
    """A number of the structure, relative: as stated, by how much it was changed, and to what it is known then."""

    name: str
    stated: Known
    change: Known
    standard_error: Known


class RefinementPart(Part):
    """How the laws were refined on the simulated response; ends: χ² from each start."""

    refined: bool
    reason: str
    before: Maybe
    after: Maybe
    ends: list[Maybe]


class StructureRecord(Part):
    """``discover RIG --json`` and ``structure.json``."""

    schema_: Version
    rig: str
    laws: list[StructureLaw]
    joints: list[SeenPart]
    sensors: list[SensorPart]
    structure: list[NumberPart]
    misfit: Maybe
    refinement: RefinementPart | None
    warnings: list[str]
