"""What the data cannot show or show wrongly: a record for each fault, what it does to the law, the verdict of all."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal, get_args

from sindyjoint.described import same
from sindyjoint.hooks import fetched
from sindyjoint.mechanics.rig_test import BASE, DRIVE, RigTest
from sindyjoint.record import MEASURED_ANGLE, MEASURED_RATE, Campaign, Motion
from sindyjoint.text import quantities

__getattr__ = fetched(
    __name__,
    {
        "check": "Check check_data find_faults",
        "detectors": "record_of",
        "detectors.course": "step_of",
        "detectors.sizes": "find_disagreement main_line",
        "law": "MOST_HARMONICS POINTS cycles_of",
        "law.odd_runs": "Held find_odd_runs find_other_scales",
        "masking": "bridge mask_faults mask_run",
        "warnings": "identifiability_notes",
    },
)


#: Stretches of samples at fault, from inclusive to exclusive.
Spans = tuple[tuple[int, int], ...]
Severity = Literal["stops", "biases", "note"]
SoundnessVerdict = Literal["sound", "doubtful", "unsound"]


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
    "other_sensor",
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
    "unsettled_guess",
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
    spans: Spans = field(default=(), repr=False)
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
        severities = {finding.severity for finding in self.findings}
        if "stops" in severities:
            return "unsound"
        return "doubtful" if "biases" in severities else "sound"

    WRITTEN: ClassVar = same("verdict", "ids", "accepted")

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of what was found."""
        return tuple(dict.fromkeys(finding.id for finding in self.findings))


def in_order(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return findings, the severest first, one of each kind for each run and channel: the first."""
    unique: dict[tuple[str, str | None, str | None], Finding] = {}
    for finding in findings:
        unique.setdefault((finding.id, finding.run, finding.channel), finding)
    return tuple(sorted(unique.values(), key=lambda f: get_args(Severity).index(f.severity)))


OF_QUANTITY = {"acceleration": "m/s^2", "velocity": "m/s", "displacement": "m"}
MOMENT, OTHER, STRUCTURE = "moment", "", "structure"
SHOWN_BY = {
    DRIVE: "the drive is wrong by that, and with it k1, k3, c1 and M_F of every joint",
    "time": "all frequencies are wrong by that factor, c1 too, and the inertia by its square",
}
SHOWN = "what this sensor adds to the recovered angles and moments is wrong, and with it k1, k3, c1 and M_F"
TWICE = (
    "the same evidence counts twice: every interval (k1, c1, M_F ...) is too narrow, and nothing is held out"
)
STILL = "averages motion with standstill: k1, c1 and M_F belong to no amplitude that was tested"
LEVELS = "averages periods of two levels: k3 is taken for k1, and M_F for c1"
#: By fault: what it does as one of the moment, of any other channel of a joint, of a channel of a structure.
EFFECTS: dict[str, dict[str, str]] = {
    "frozen_channel": {
        OTHER: "the run says nothing of the joint and pulls every coefficient towards zero",
        STRUCTURE: "exact zeros outweigh every other sensor and pull all that is recovered towards zero",
    },
    "no_signal": {
        OTHER: "the samples say nothing of the law: no coefficient can be fitted",
        STRUCTURE: "{shown}",
    },
    "saturation": {
        MOMENT: "lowers the largest {moment}: softens the law, k1 and k3 come out too small",
        OTHER: "cuts the crests of the motion: k1, k3 and every derivative (c1, inertia) are wrong",
        STRUCTURE: "its harmonics are too small, and others appear; {shown}",
    },
    "dropouts": {
        MOMENT: "pulls k1 and M_F towards zero",
        OTHER: "makes motion look like sticking and spoils the derivatives: c1, M_F and k1",
        STRUCTURE: "pulls its harmonics towards zero; {shown}",
    },
    "spikes": {
        MOMENT: "raise the noise floor and shift every coefficient, M_F and k1 most",
        OTHER: "spoil the derivatives: c1, the inertia and every interval",
        STRUCTURE: "raise the noise at all harmonics; {shown}",
    },
    "coarse_quantisation": {
        OTHER: "steps follow the motion and do not average out: shifts k1, k3 and M_F",
        STRUCTURE: "steps follow the motion and do not average out; {shown}",
    },
    "few_samples_per_period": {
        OTHER: "few harmonics remain: k3 and c1 carry an error of the processing",
        STRUCTURE: "few harmonics remain: the corners of friction, and with them M_F and c1, are hardly seen",
    },
    "repeated_block": {
        OTHER: "shifts the time from there on: k1, c1 and the noise floor are averages of two phases",
        STRUCTURE: "shifts the time from there on: what is recovered is an average of two phases, its noise too large",
    },
    "duplicate_run": {OTHER: TWICE},
    "scaled_copy": {
        OTHER: "one recording counts as two levels: k1 and k3 follow from a run that was never made",
        STRUCTURE: TWICE,
    },
    "dead_start": {OTHER: STILL},
    "dead_tail": {OTHER: STILL},
    "lost_samples": {
        OTHER: "periods are averaged out of phase: k1, k3, c1 and M_F come out wrong, and the noise floor too large",
        STRUCTURE: "periods are averaged out of phase: k1, c1 and M_F come out wrong, and the noise too large",
    },
    "channel_slip": {
        OTHER: "shifts c1 by about k1 times that delay",
        STRUCTURE: "two halves of the run contradict each other: all that is recovered of it is their mean",
    },
    "sign_flips": {
        OTHER: "the sign of k1, c1 and M_F changes within the run",
        STRUCTURE: "two halves of the run contradict each other: all that is recovered of it is their mean",
    },
    "gain_changes": {
        OTHER: "every coefficient (k1, c1, M_F) is a mean of two gains, or of two states of the joint",
        STRUCTURE: "what is recovered of the run is a mean of two gains",
    },
    "level_changes": {OTHER: LEVELS},
    "zero_jumps": {
        MOMENT: "raises the noise floor and shifts k2 and the unequal parts of M_F",
        OTHER: "raises the noise floor and moves the zero from which k1, k2 and k3 are counted",
    },
    "clock_drift": {OTHER: "the growing delay shifts c1 by about k1 times its mean"},
    "excess_noise": {
        MOMENT: "widens the intervals of all coefficients",
        OTHER: "noise of the motion pulls k1 and c1 towards zero",
    },
    "mains_hum": {
        MOMENT: "raises the noise floor; where the mains is a harmonic of the excitation, shifts k3 and M_F",
        OTHER: "grows with each derivative: spoils c1 and the inertia",
    },
    "unit_mismatch": {
        MOMENT: "k1, c1 and M_F are wrong by that factor",
        OTHER: "k1 and c1 are wrong by that factor, k3 by its cube",
        "time": "{shown}",
        STRUCTURE: "{shown}",
    },
    "other_sensor": {
        MOMENT: "part of the {moment} that moves the joint may be missing: every coefficient is smaller by that",
        OTHER: "the motion may be that of one body and not of the joint: k1, c1 and M_F come out too small",
    },
}
EFFECTS |= {
    "frozen_segment": EFFECTS["dropouts"],
    "drift": {**EFFECTS["zero_jumps"], "None": EFFECTS["zero_jumps"][MOMENT]},
}


@dataclass(frozen=True)
class Words:
    """Names and units of channels.

    Parameters
    ----------
    units : mapping of str to str
        By channel.
    names : mapping of str to str
        What sentences and tables call channels, where another name than their own.
    motion : {"rotation", "translation"}
        Of the joint, or of a structure's joints.
    structure : bool
        Whether they are those of a structure.
    """

    units: Mapping[str, str]
    names: Mapping[str, str]
    motion: Motion
    structure: bool = False

    def of(self, channel: str | None) -> str:
        """Return the name of a channel as a sentence has it, such as ``"displacement"`` for ``"angle"``."""
        if self.structure and channel not in (DRIVE, "time"):
            return f"sensor {channel!r}"
        return self.label(str(channel))

    def label(self, channel: str) -> str:
        """Return the name of a channel as a table has it."""
        return self.names.get(channel, channel)

    def unit(self, channel: str) -> str:
        """Return the unit of a channel."""
        return self.units.get(channel, "s")

    @property
    def done(self) -> str:
        """What becomes of samples at fault."""
        return "filled in" if self.structure else "left out"

    def effect(self, kind: str, channel: str | None) -> str:
        """Return what a fault of a channel does to the law."""
        known = EFFECTS[kind]
        text = known.get(STRUCTURE if self.structure else str(channel), known.get(OTHER, ""))
        return text.format(moment=self.label(MOMENT), shown=SHOWN_BY.get(str(channel), SHOWN))

    def finding(
        self,
        kind: str,
        run: str | None,
        channel: str | None,
        severity: Severity,
        extent: str,
        remedy: str,
        spans: Spans = (),
        masked: bool = False,
    ) -> Finding:
        """Return a finding with what such a fault does."""
        return Finding(
            kind, run, channel, severity, extent, self.effect(kind, channel), remedy, spans, masked
        )


def words_of(motion: Motion) -> Words:
    """Return the words of a joint's kind of motion."""
    q = quantities(motion)
    path, speed, acceleration = q.angle.lower(), q.rate.lower(), f"{q.angle_unit}/s^2"
    units = {
        "moment": q.moment_unit, "angle": q.angle_unit, "rate": q.rate_unit, "acceleration": acceleration,
        MEASURED_ANGLE: q.angle_unit, MEASURED_RATE: q.rate_unit,
    }  # fmt: skip
    names = {
        "moment": q.moment.lower(), "angle": path, "rate": speed,
        MEASURED_ANGLE: f"{path} sensor", MEASURED_RATE: f"{speed} sensor",
    }  # fmt: skip
    return Words(units, names, motion)


def words_of_data(measured: Campaign | RigTest) -> Words:
    """Return what the channels of a campaign, or of a structure's test, are called."""
    if not isinstance(measured, RigTest):
        return words_of(measured.joint.motion)
    units = {DRIVE: "m/s^2" if measured.at == BASE else "N"}
    units |= {sensor.name: OF_QUANTITY[sensor.quantity] for sensor in measured.sensors}
    return Words(units, {}, measured.motion, True)
