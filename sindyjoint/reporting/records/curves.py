"""``curves.json``: curves of a joint and of a structure."""

from __future__ import annotations

from sindyjoint.reporting.records.parts import Joint, Known, Maybe, Part, Version


class CurvesJoint(Part):
    """The joint of a model."""

    name: str
    motion: Joint


class TestedPart(Part):
    """Largest of the runs that the model was fitted to, rad and rad/s (m, m/s)."""

    angle: Known
    rate: Known


class MeasurePart(Part):
    """A measure over the amplitudes, and the ends of its 95 % interval."""

    value: list[Known]
    low: list[Known]
    high: list[Known]


class JointCurvePart(Part):
    """One frequency, Hz: amplitude, rad (m), stiffness, N·m/rad (N/m), loss factor, and energy per cycle, J."""

    frequency: Known
    amplitude: list[Known]
    secant: MeasurePart
    storage: MeasurePart
    loss_factor: MeasurePart
    energy: MeasurePart
    tested: list[bool]


class JointCurvesRecord(Part):
    """``curves MODEL --json`` and ``curves.json``: a joint over its amplitude."""

    schema_: Version
    joint: CurvesJoint
    equation: str
    tested: TestedPart
    curves: list[JointCurvePart]
    warnings: list[str]


class JointInCurves(Part):
    """A joint of the rig; null where no model says up to which angle it was tested, rad."""

    name: str
    tested_angle: Maybe


class FrequenciesOfCurves(Part):
    """Natural frequencies with the joints' stiffness at zero, and with locked joints, Hz."""

    sliding: list[Known]
    locked: list[Known]


class ModePart(Part):
    """A mode over its amplitude: m at the point, Hz, ratio to critical damping, N; angles by joint, rad."""

    number: int
    point: str
    slips: list[Maybe]
    amplitude: list[Known]
    frequency: list[Known]
    damping: list[Known]
    frequency_error: list[Known]
    damping_error: list[Known]
    force: list[Known]
    tested: list[bool]
    angle: list[list[Known]]


class PeakPart(Part):
    """The largest response, Hz and m."""

    frequency: Known
    amplitude: Known
    interval95: tuple[Known, Known]


class LevelPart(Part):
    """Frequency response at a force, N: Hz, m, rad; angles by joint, rad; errors across the curve, Hz and ln m."""

    force: Known
    peak: PeakPart
    folds: list[Known]
    frequency: list[Known]
    amplitude: list[Known]
    phase: list[Known]
    stable: list[bool]
    tested: list[bool]
    frequency_error: list[Known]
    log_error: list[Known]
    angle: list[list[Known]]


class StructureCurvesRecord(Part):
    """``curves RIG --json`` and ``curves.json``: frequency response by level, modes over amplitude."""

    schema_: Version
    rig: str
    motion: Joint
    at: str
    point: str
    harmonics: int
    joints: list[JointInCurves]
    frequencies: FrequenciesOfCurves
    modes: list[ModePart]
    levels: list[LevelPart]
    warnings: list[str]
