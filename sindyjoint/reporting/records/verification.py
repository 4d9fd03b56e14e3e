"""``verification.json``: a model against measured responses."""

from __future__ import annotations

from typing import Literal

from sindyjoint.reporting.records.discovery import TrustPart
from sindyjoint.reporting.records.parts import Known, Maybe, Part, SoundnessPart, Version


class CyclesPart(Part):
    """Half-cycles of a response: s, the unit of the response, s."""

    time: list[Known]
    amplitude: list[Known]
    period: list[Known]


class BothCycles(Part):
    """Half-cycles of the measured and of the simulated response."""

    measured: CyclesPart | None
    simulated: CyclesPart | None


class BothEnergies(Part):
    """Energy dissipated in each cycle, J."""

    measured: list[Known]
    simulated: list[Known]


class VerifiedRun(Part):
    """A run against its simulation; ``--json`` has the first six keys, ``verification.json`` all."""

    name: str
    response_nrmse: Maybe
    moment_nrmse: Maybe
    rmse: Maybe
    rmse_unit: str
    seen: bool | None = None
    drive: Literal["moment", "windows", "motion", "free run", "pulse", "steady", "standstill"] | None = None
    channel: Literal["angle", "moment", "displacement", "force", "velocity", "acceleration"] | None = None
    noise_floor: Maybe = None
    amplitude_rms_error: Maybe = None
    mean_period_difference: Maybe = None
    failure: str | None = None
    cycles: BothCycles | None = None
    energy_per_cycle: BothEnergies | None = None


class SubjectPart(Part):
    """What the model was compared with."""

    kind: Literal["rig", "campaign"]
    name: str


class VerificationRecord(Part):
    """``verify --json`` and ``verification.json``, which has subject, reason and tolerance, too."""

    schema_: Version
    trust: TrustPart | None = None
    verdict: Literal["passed", "failed"]
    response_nrmse: Maybe
    moment_nrmse: Maybe
    noise_floor: Maybe
    amplitude_rms_error: Maybe
    mean_period_difference: Maybe
    free_run: int | None
    runs: list[VerifiedRun]
    warnings: list[str]
    soundness: SoundnessPart | None = None
    subject: SubjectPart | None = None
    reason: str | None = None
    tolerance: Maybe = None
