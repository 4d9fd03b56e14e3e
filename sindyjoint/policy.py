"""Limits that decide an answer, as data: of each folder one frozen record of them, every field explained.

Constants of numerics stay where they are used; what is here can be read with ``--verbose`` and in the guide.
"""

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


@dataclass(frozen=True)
class SharedPolicy:
    """What is asked in more than one folder, whose records inherit it: one meaning, one limit."""

    # How sure.
    outstanding: float = limit(
        4.0,
        "standard errors, or times what is usual among neighbours or other runs, from which something stands out",
        source="normal noise gets there once in 16 000 cases",
    )
    likely: float = limit(
        2.0,
        "standard errors within which a number may be where it is not seen, and that it keeps its sign by",
        source="one in twenty; with three or four groups a jackknife cannot ask for more",
    )
    significant: float = limit(
        3.0,
        "standard errors beyond which a number is another one, or not zero; and what one run counts for at most",
        source="a chance of 0.3 % for a normal deviate",
    )
    stands_out: float = limit(
        6.0,
        "the same where errors are known roughly, or where many harmonics, half-cycles or terms are asked",
        source="terms that are not there stay below 4 on simulated rigs, true ones of 0.1 % of the moment reach 20",
    )
    level: float = limit(
        0.05,
        "risk of finding something in what does not differ, over all that is looked for",
        source="convention",
    )
    strict_level: float = limit(
        0.01,
        "the same where an error costs more: joints that are declared alike, a change called within its margin",
        source="at 5 % one campaign in twenty would be lost",
    )
    confident: float = limit(
        0.95,
        "probability, or share of joints or resampled campaigns, from which on something is sure",
        source="convention",
    )
    mostly: float = limit(
        0.5,
        "probability, coherence or share from which on something holds rather than not",
        source="convention",
    )
    clearly: float = limit(
        1.5,
        "ratio from which one value is clearly larger than another: a misfit than its noise, what differs from period "
        "to period, explanations, gains",
        source="a noise floor is known within that factor; gaps end at 0.8 to 1.1 once what is missing is found",
    )
    contradicts: float = limit(
        2.0,
        "ratio beyond which two sizes contradict each other: noise by spectrum and by differences, the mean square "
        "of a structure's sensors and their noise, held-out error and residual",
        source="noise alone makes 1",
    )
    many_times: float = limit(
        10.0,
        "ratio from which one size is of another kind: a unit, a motion, a misfit beside its noise; standard errors "
        "from which a harmonic is the measured one; how much better a change of all parameters is known than each",
        source="known to a tenth",
    )
    scatter: int = limit(
        5,
        "fewest joints, or simulated sets of coefficients, of which a scatter is reported",
        source="fewer show chance",
    )
    fewest: int = limit(
        3, "periods, repetitions, runs, frequencies or levels from which on they tell anything of each other"
    )
    # How much: shares of a range, an amplitude, an RMS.
    unknown: float = limit(
        0.3,
        "relative error from which a size is unknown: a gain or a phase that stops, a moment that sensors do not show, "
        "a misfit beside the floor; spike, in amplitudes of its channel, that is reported",
        source="between what 69 injected faults and sound campaigns of random joints show",
    )
    large_part: float = limit(
        0.2,
        "share from which a part is a large one: of a run, of an RMS that is left unexplained or does not repeat; and "
        "by which a coefficient of a rough idea may differ",
    )
    alike: float = limit(
        0.15,
        "relative RMS difference up to which two motions are one: segments of an excitation, a simulation that "
        "completes the states of a run; and of two ranges of the angle up to which they are one level",
        source="twice 5 % noise, and √2",
    )
    minor_share: float = limit(
        0.1, "share up to which a part does not count, or two things are nearly the same", source="judgement"
    )
    margin: float = limit(
        0.10,
        "relative change of a coefficient, over the band or between tests, that would not matter, unless given",
    )
    tolerated: float = limit(
        0.05,
        "share by which what is compared may differ: motions, levels, a description, a verified response, a tested "
        "range; change along a run (amplitudes, rad) that counts",
        source="convention: moves a coefficient by a twentieth",
    )
    small_share: float = limit(
        0.01,
        "share, of the moment, of a run or of a frequency, that is as good as nothing beside sensors and noise",
    )
    trivial_share: float = limit(
        0.005, "share within which gaps are alike, a channel does not drift, and a law that is given is known"
    )
    granted_share: float = limit(
        0.003,
        "share that is taken for granted: scatter from period to period, motion that has settled, error of a model in "
        "a structure, of a harmonic of which the law tells more",
        source="between what 69 injected faults and sound campaigns of random joints show",
    )
    accuracy: float = limit(
        0.002,
        "share below which nothing can be distinguished from errors of sensors, of the processing, of a description",
    )
    simulated: float = limit(
        1e-4,
        "relative error that a simulation leaves: of the numbers of a law, and of a response, which is weighed no more",
        source="without noise, weighed as with it: at most 0.03 % of k3, 0.02 % of k2, 0.005 % of k1, c1 and M_F",
    )


SHARED = SharedPolicy()


def described(policy: Any) -> tuple[Limit, ...]:
    """Return the limits of a policy in their order, without those that it shares with the others."""
    shared = {} if policy is SHARED else vars(SHARED)
    own = {f.name: getattr(policy, f.name) for f in fields(policy)}
    return tuple(
        Limit(f.name, own[f.name], **f.metadata)
        for f in fields(policy)
        if f.name not in shared or own[f.name] != shared[f.name]
    )


def policies() -> dict[str, Any]:
    """Return every policy, by the folder whose limits it holds.

    Of a folder with several, each stands under the folder and its own name: ``"diagnosis structure"``.

    Returns
    -------
    dict of str to dataclass
        See :func:`sindyjoint.policy.described` for what each field says.
    """
    found = {}
    for place in ("policy", "limits", "diagnosis.policy"):
        *folders, _ = place.split(".")
        for name, record in vars(import_module(f"sindyjoint.{place}")).items():
            if (
                is_dataclass(record)
                and not isinstance(record, type)
                and all(f.metadata for f in fields(record))
            ):
                found[" ".join(folders if name == "POLICY" else [*folders, name.lower()])] = record
    return found
