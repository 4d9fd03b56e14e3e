"""What a search for terms comes to, and what everybody asks of it first: can I trust it, and what next."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sindyjoint.limits import JUDGEMENT
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.paper import JOINTS
from sindyjoint.record import Campaign
from sindyjoint.trust import Light

# Commands that several headlines advise, and what they are for.
SEE_FAULTS = ("sindyjoint check CAMPAIGN --out soundness", "see the faults of the data in every channel")
VERIFY = ("sindyjoint verify RESULTS CAMPAIGN", "simulate the model and hold it against the runs")
EXPORT = (
    "sindyjoint export RESULTS --to python --out joint",
    "use the model in other programs; sindyjoint export --help lists them",
)
LACKING = ("sindyjoint diagnose CAMPAIGN", "find and name what the model lacks")
TELL_ALIKE = "tell terms apart that are alike on these runs"

# What runs recovered inside a structure say: their laws are compared by none of the verbs.
RECOVERED = (
    "angle and moment were recovered from the structure's sensors; where these show no constant, the angle at which "
    "the joint rests is the law's, and a preload is not determined"
)


@dataclass(frozen=True)
class Excitations:
    """What was tested, as far as trust depends on it.

    Parameters
    ----------
    frequencies : tuple of float
        Of periodic runs, Hz.
    levels : tuple of str
    runs : int
    recovered : bool
        Whether the runs were recovered from the sensors of a structure.
    """

    frequencies: tuple[float, ...]
    levels: tuple[str, ...]
    runs: int
    recovered: bool = False

    @classmethod
    def of(cls, measured: Campaign | RigTest) -> "Excitations":
        """Return what the runs of a campaign, or of a structure's test, that are fitted to excite."""
        runs = measured.identification_runs
        frequencies = tuple(run.frequency for run in runs if run.frequency is not None)
        return cls(
            frequencies,
            tuple(run.level for run in runs if run.level is not None),
            len(runs),
            isinstance(measured, Campaign) and RECOVERED in measured.notes,
        )


def is_of_the_paper(joint: str) -> bool:
    """Return whether a joint is one of the paper's, by its name."""
    return joint.strip().lower() in JOINTS


def next_steps(lights: Sequence[Light], tested: Excitations, found: bool) -> tuple[tuple[str, str], ...]:
    """Return what to do, for each light that is not good in the order in which one depends on the other."""
    weak = {light.name for light in lights if light.colour != "good"}
    impossible = any(light.inertia is not None for light in lights)
    comparable = "predicts" in weak and tested.runs > 1 and not tested.recovered
    alike = "determined" in weak or ("predicts" in weak and tested.runs == 1)
    other = ("sindyjoint compare CAMPAIGN", "see whether another method or library finds a model")
    steps = steps_of(
        ("data" in weak, SEE_FAULTS),
        (not found and tested.recovered, ("record runs that move the joint more", "find its law")),
        (not found and not tested.recovered, other),
        (
            found and impossible,
            ("sindyjoint check CAMPAIGN", "find runs in other units, delays and wrong rates"),
        ),
        (found and "explained" in weak, LACKING),
        (
            found and comparable,
            ("sindyjoint compare CAMPAIGN", "see which terms hold at every frequency and method"),
        ),
        (found and alike, (advise_runs(tested), TELL_ALIKE)),
        (found and not weak, VERIFY),
        (found and not weak, EXPORT),
    )
    return tuple(steps[:2])


def steps_of(*cases: tuple[object, tuple[str, str]]) -> list[tuple[str, str]]:
    """Return the steps of the cases that are there, in their order."""
    return [step for there, step in cases if there]


def advise_runs(tested: Excitations) -> str:
    """Return which runs to record next: frequencies between and beside those tested, and further levels."""
    frequencies = sorted(set(tested.frequencies))
    if not frequencies:
        return "record the same motion again, and once at half its amplitude"
    missing = []
    need = JUDGEMENT.fewest - len(frequencies)
    if need > 0:
        # One lies in the widest gap; of a single frequency there is none.
        lowest, highest = frequencies[0], frequencies[-1]
        beside = (
            [lowest / 1.5, highest * 1.5]
            if lowest == highest
            else [math.sqrt(lowest * highest), highest * 1.5]
        )
        missing.append(" and ".join(f"{frequency:.2g} Hz" for frequency in beside[:need]))
    levels = JUDGEMENT.fewest - len(set(tested.levels))
    if levels > 0:
        missing.append(f"{levels} more level{'s' * (levels > 1)}")
    return (
        f"record runs at {' and at '.join(missing)}"
        if missing
        else f"record {len(frequencies)} runs more, one at each frequency"
    )
