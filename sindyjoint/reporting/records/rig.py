"""``rig.json``, a structure in motion, and what ``simulate --json`` prints of a virtual test."""

from __future__ import annotations

from sindyjoint.reporting.records.parts import Known, Maybe, Part, Version


class FrequenciesPart(Part):
    """Natural frequencies, Hz."""

    slipping: list[Known]
    locked: list[Known]


class PointPart(Part):
    """A point of the structure, m."""

    name: str
    peak: Known


class RigJoint(Part):
    """A joint of the structure: rad, s, J."""

    name: str
    peak_angle: Known
    locked_share: Known
    last_slip: Known
    dissipated: Known


class RigRecord(Part):
    """``rig --json`` and ``rig.json``: a structure in motion."""

    schema_: Version
    rig: str
    frequencies: FrequenciesPart
    duration: Known
    points: list[PointPart]
    joints: list[RigJoint]
    beams_dissipated: Known
    warnings: list[str]


class SimulatedRunPart(Part):
    """A run that was made."""

    name: str
    frequency: Maybe
    level: str | None
    samples: int


class SimulationRecord(Part):
    """``simulate --json``: a virtual test."""

    schema_: Version
    manifest: str
    joint: str
    runs: list[SimulatedRunPart]
