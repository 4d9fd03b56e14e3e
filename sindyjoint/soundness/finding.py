"""What a check of the data finds: one record for each fault, and the verdict that they make together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from sindyjoint.described import same

Severity = Literal["stops", "biases", "note"]
SoundnessVerdict = Literal["sound", "doubtful", "unsound"]


ORDER = {"stops": 0, "biases": 1, "note": 2}
#: The ids that findings have: what ``--accept`` takes.
KINDS = (
    "ac_coupling",
    "angle_offset",
    "channel_delay",
    "channel_slip",
    "channels_disagree",
    "clock_drift",
    "coarse_quantisation",
    "coverage",
    "dead_start",
    "dead_tail",
    "drift",
    "dropouts",
    "duplicate_channel",
    "duplicate_run",
    "excess_noise",
    "few_samples_per_period",
    "frozen_channel",
    "frozen_segment",
    "gain_changes",
    "gain_differs",
    "gives_off_energy",
    "implausible_size",
    "level_changes",
    "lost_samples",
    "low_pass",
    "mains_hum",
    "no_signal",
    "repeated_block",
    "reversed_sign",
    "run_differs",
    "saturation",
    "scaled_copy",
    "sensors_disagree",
    "sign_flips",
    "spikes",
    "structure_differs",
    "swapped_channels",
    "unit_mismatch",
    "wrong_frequency",
    "zero_jumps",
)
DELAY = "channel_delay"
#: What shifts one channel against the other in time: damping and friction change places with stiffness.
PHASE = (DELAY, "ac_coupling", "channel_slip", "clock_drift", "low_pass")


@dataclass(frozen=True)
class Finding:
    """One fault of the data.

    Parameters
    ----------
    id : str
        Kind of fault, such as ``"saturation"``; what ``--accept`` takes.
    run : str or None
        Name of the run; ``None`` where the fault is of the campaign as a whole.
    channel : str or None
        ``"moment"``, ``"angle"``, ``"rate"`` or ``"time"``, whatever the motion; ``None`` where it is of no single one.
    severity : {"stops", "biases", "note"}
        Whether no model can be trusted, coefficients are shifted, or it is merely good to know.
    extent : str
        How much, with its number and unit: ``"2.1 % of the samples at the highest value"``.
    effect : str
        What it would do, and to which coefficient.
    remedy : str
        What to do about it.
    spans : tuple of (int, int)
        Samples concerned, from inclusive to exclusive, for the picture.
    masked : bool
        Whether those samples can be, and therefore are, left out of every fit.
    """

    id: str
    run: str | None
    channel: str | None
    severity: Severity
    extent: str
    effect: str
    remedy: str
    spans: tuple[tuple[int, int], ...] = field(default=(), repr=False)
    masked: bool = False

    WRITTEN: ClassVar = same("id", "run", "channel", "severity", "extent", "effect", "remedy")


@dataclass(frozen=True)
class Soundness:
    """The findings of a campaign, and which of them the user accepts.

    Parameters
    ----------
    findings : tuple of Finding
        The severest first.
    accepted : tuple of str
        Ids of findings that no longer stop the work.
    """

    findings: tuple[Finding, ...] = ()
    accepted: tuple[str, ...] = ()

    @property
    def stopping(self) -> tuple[Finding, ...]:
        """Findings under which no model is made."""
        return tuple(f for f in self.findings if f.severity == "stops" and f.id not in self.accepted)

    @property
    def verdict(self) -> SoundnessVerdict:
        """``"unsound"`` where something stops, accepted or not, ``"doubtful"`` where it biases, or ``"sound"``."""
        return verdict_of(self.findings)

    WRITTEN: ClassVar = same("verdict", "ids", "accepted")

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of what was found."""
        return tuple(dict.fromkeys(finding.id for finding in self.findings))


def verdict_of(findings: Sequence[Finding]) -> SoundnessVerdict:
    """Return the verdict on a list of findings."""
    severities = {finding.severity for finding in findings}
    if "stops" in severities:
        return "unsound"
    return "doubtful" if "biases" in severities else "sound"


def in_order(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return findings, the severest first, one of each kind for each run and channel: the first."""
    unique: dict[tuple[str, str | None, str | None], Finding] = {}
    for finding in findings:
        unique.setdefault((finding.id, finding.run, finding.channel), finding)
    return tuple(sorted(unique.values(), key=lambda f: ORDER[f.severity]))
