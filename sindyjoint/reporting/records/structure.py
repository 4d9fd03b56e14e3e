"""``structure.json``: the laws of the joints inside a structure."""

from __future__ import annotations

from sindyjoint.reporting.records.discovery import DiscoveryRecord
from sindyjoint.reporting.records.parts import Known, Maybe, Part, SoundnessPart, Version


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
    soundness: SoundnessPart | None = None
