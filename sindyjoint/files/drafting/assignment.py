"""Which column is which channel, in which unit: what names and shapes tell, and questions where they do not."""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from sindyjoint.errors import InputError, UnknownNameError, nearest, refuse
from sindyjoint.files.channels import CHANNEL_KEYS, KEYS
from sindyjoint.files.drafting.survey import (
    LOADS,
    MOTIONS,
    ROLES,
    SI_UNITS,
    WORDS,
    Bundle,
    Column,
    is_clock,
    is_twin,
)
from sindyjoint.files.manifest import NONE
from sindyjoint.files.timeaxis import decays
from sindyjoint.files.units import COUNTS, KNOWN, conversion, needs_gain, parse_quantity, unit_ratio
from sindyjoint.numeric import Array
from sindyjoint.record import Motion

_OWN = {motion: {key for key, _ in keys.values()} - {"acceleration"} for motion, keys in KEYS.items()}
ANSWERS = (
    "name",
    "motion",
    "inertia",
    "mass",
    "time",
    "time.unit",
    "rate",
    "runs",
    "validate",
    "inputs",
) + tuple(f"{key}{part}" for key in CHANNEL_KEYS for part in ("", ".unit", ".gain"))
# Never taken for moment or angle, whatever else is missing.
OTHERS = {"time", "temperature", "acceleration", "velocity", "angular rate", "counter"}
# What a lever makes a channel of, and the gain of one of 0.2 m.
LEVERS = {
    "moment": ("force", "0.2 m"), "angle": ("displacement", "5 rad/m"),
    "force": ("moment", "5 1/m"), "displacement": ("angle", "0.2 m/rad"),
}  # fmt: skip
# What a joint carries that swings freely.
NO_LOAD: dict[Motion, str] = {"rotation": "0 N*m", "translation": "0 N"}
EXAMPLES = {"moment": "N*m", "angle": "mrad", "force": "N", "displacement": "mm", "rate_of_angle": "rad/s"}


@dataclass(frozen=True)
class Question:
    """What the files do not say.

    Parameters
    ----------
    key : str
        By which it is answered: ``"angle.unit"``, ``"rate"`` ...
    text : str
        The question.
    guess : str or None
        The likeliest answer; None where any would be invented.
    complaint : str
        What was wrong with the last answer, where it is asked again.
    """

    key: str
    text: str
    guess: str | None
    complaint: str = ""


@dataclass
class Dialogue:
    """Collects questions while a manifest is drafted, and gives the answers that are there already.

    Parameters
    ----------
    answers : mapping of str to str
    """

    answers: Mapping[str, str]
    questions: dict[str, Question] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for key in self.answers:
            if key not in ANSWERS:
                raise UnknownNameError(
                    f"{key!r} is nothing that can be set; {nearest(key, ANSWERS, 'known:')}"
                )

    def ask(self, key: str, text: str, guess: str | None) -> str | None:
        """Return the answer to a question, or its guess, which is then a doubt."""
        if key in self.answers:
            return self.answers[key]
        self.questions.setdefault(key, Question(key, text, guess))
        return guess

    def why(self, key: str, otherwise: str) -> str:
        """Return where a value comes from: it was set, guessed, or what is said otherwise."""
        return "set" if key in self.answers else "guessed" if key in self.questions else otherwise

    def mark(self, *keys: str) -> str:
        """Return the comment that marks a line of the manifest with a guess in it."""
        return "  # guessed" if any(key in self.questions for key in keys) else ""


def find_motion(bundles: Sequence[Bundle], dialogue: Dialogue) -> Motion:
    """Return the kind of motion that the columns speak of, or that was answered, as all answers must agree with it."""
    roles = [column.role for bundle in bundles for column in bundle.columns]
    counts = {motion: sum(role in known.values() for role in roles) for motion, known in ROLES.items()}
    guess: Motion = "translation" if counts["translation"] > counts["rotation"] else "rotation"
    # Who answers what the force is has answered this.
    answers = dialogue.answers
    answered = {key.partition(".")[0] for key in answers}
    implied = [motion for motion in ROLES if _OWN[motion] & answered]
    answer = answers.get("motion") or (implied[0] if len(implied) == 1 else None)
    if answer is None and counts["translation"] == counts["rotation"]:
        answer = dialogue.ask(
            "motion",
            "does the joint rotate or slide (rotation; or translation, with force and displacement)?",
            guess,
        )
    if answer not in (None, *ROLES):
        raise InputError(f"motion is {answer!r}; expected 'rotation' or 'translation'")
    motion: Motion = guess if answer is None else answer
    other: Motion = "rotation" if motion == "translation" else "translation"
    refuse(
        (
            key in _OWN[other],
            f"{key!r} is answered, and the joint is one in {motion}; expected {', '.join(sorted(_OWN[motion]))}, or "
            f"motion={other}",
        )
        for key in sorted(answered)
    )
    for quantity, (key, si) in KEYS[motion].items():
        unit, gain = answers.get(f"{key}.unit"), answers.get(f"{key}.gain")
        if quantity == "inertia" and key in answers:
            parse_quantity(answers[key], si, key)
        if unit is not None and not (gain is None and (needs_gain(unit) or quantity == "acceleration")):
            conversion(unit, si, f"{key}.unit", gain)
    if "time.unit" in answers:
        conversion(answers["time.unit"], "s", "time.unit")
    return motion


def assign_columns(
    bundle: Bundle, motion: Motion, dialogue: Dialogue, peers: Sequence[Bundle] = ()
) -> dict[str, Column]:
    """Return the columns of moment and angle, and those of time and rate if there are any.

    Which of several a channel is, the shapes of all files with these columns decide together.

    A column of acceleration is used where there is none of the angle, or where it was named; there is no column of the
    moment where a joint swings freely and nothing was recorded of a load.

    Raises
    ------
    InputError
        When a run has too few columns, or an answer names none.
    """
    found: dict[str, Column] = {}
    answers, alike = dialogue.answers, [peer for peer in peers if peer.titles == bundle.titles] or [bundle]
    clock = _choose(bundle, "time", "time", [c for c in bundle.columns if c.role == "time"], dialogue)
    if clock is None:
        clock = next((c for c in bundle.columns if c.role is None and is_clock(c.values)), None)
    if clock is not None:
        found["time"] = clock
    shaking = [c for c in bundle.columns if c.role == "acceleration" and np.ptp(c.values) > 0]
    accelerometer = _choose(bundle, "acceleration", "acceleration", shaking[:1], dialogue)
    for quantity, role in ROLES[motion].items():
        key = KEYS[motion][quantity][0]
        free = [column for column in bundle.columns if column not in found.values()]
        candidates = [column for column in free if column.role == role] or [
            column for column in free if column.role == "position" and quantity == "angle"
        ]
        if quantity == "moment" and _is_unloaded(bundle, candidates, free, key, motion, dialogue):
            continue
        chosen = _choose(bundle, key, role, candidates, dialogue)
        if chosen is None and quantity == "angle" and accelerometer is not None:
            continue
        if chosen is None and quantity != "rate":
            chosen = _guess_by_shape(bundle, quantity, key, free, dialogue, alike)
        # A velocity beside the displacement is welcome, not needed: nobody is asked for its unit.
        untold = (
            quantity == "rate"
            and chosen
            and not (chosen.unit and unit_ratio(chosen.unit, KEYS[motion]["rate"][1]))
            and not {key, f"{key}.unit"} & answers.keys()
        )
        if chosen is not None and not untold:
            found[quantity] = chosen
    if accelerometer is not None and ("angle" not in found or "acceleration" in answers):
        found["acceleration"] = accelerometer
    return found


def _is_unloaded(
    bundle: Bundle,
    candidates: Sequence[Column],
    free: Sequence[Column],
    key: str,
    motion: Motion,
    dialogue: Dialogue,
) -> bool:
    """Return whether no load was measured on a run because there was none: it was said, or the motion dies out."""
    if any(np.ptp(column.values) > 0 for column in candidates):
        return False
    given = dialogue.answers.get(key)
    if given is not None:
        if bundle.find(given) is None:
            # What is the name of no column is a load that was constant.
            parse_quantity(given, KEYS[motion]["moment"][1], key)
        return bundle.find(given) is None
    open_ones = [c for c in free if c.role is None and np.ptp(c.values) > 0]
    named = any(c.role in MOTIONS for c in free)
    moves = [c for c in free if c.role in MOTIONS or c in open_ones]
    if len(open_ones) > (not named) or not any(decays(column.values) for column in moves):
        return False
    none = NO_LOAD[motion]
    dialogue.ask(
        key, f"no column holds the {key}, and the motion dies out: was it a free decay, under '{none}'?", none
    )
    return True


def _choose(
    bundle: Bundle, key: str, role: str, candidates: list[Column], dialogue: Dialogue
) -> Column | None:
    """Return the column that was named, or the only one that can be meant, or the likeliest of several."""
    if key in dialogue.answers:
        answer = dialogue.answers[key]
        column, (one, sign, other) = bundle.find(answer), answer.partition(" - ")
        both = [bundle.find(each.strip()) for each in (one, other)]
        if column is None and sign and both[0] is not None and both[1] is not None:
            column = replace(both[0], minus=both[1].key, values=both[0].values - both[1].values)
        if column is None and role in LOADS and len(candidates) == 1:
            # A load that is constant in some runs was measured in this one.
            with suppress(InputError):
                parse_quantity(answer, SI_UNITS[role], key)
                return candidates[0]
        if column is None:
            raise InputError(
                f"{bundle.name}: {key} = {answer!r} is no column; columns there: {_list(bundle.columns)}"
            )
        if column.minus is None and role in MOTIONS and _differing(candidates, column):
            # Of several, this one alone: it was asked.
            column = replace(column, minus=NONE)
        return column
    moving = [column for column in candidates if np.ptp(column.values) > 0] or candidates
    # The same instants stand in every file of a run; a velocity beside the displacement is welcome, not needed.
    if len(moving) > 1 and key != "time" and not key.startswith("rate_of"):
        likeliest = _measured(moving)
        text = f"which column is the {role} ({_list(moving)})?"
        differ = _differing(moving, likeliest)
        if differ and role in MOTIONS:
            text += f" Of sensors on both sides of the joint it is '{likeliest.key} - {differ[0].key}'"
        # Which of sensors that differ is meant, nothing in the files tells.
        dialogue.ask(key, text, None if differ else str(likeliest.key))
        return likeliest
    return moving[0] if moving else None


def _differing(candidates: Sequence[Column], chosen: Column) -> list[Column]:
    """Return the candidates that move, and not as the chosen one does."""
    return [c for c in candidates if np.ptp(c.values) > 0 and not is_twin(c.values, chosen.values)]


def _guess_by_shape(
    bundle: Bundle,
    quantity: str,
    key: str,
    free: Sequence[Column],
    dialogue: Dialogue,
    alike: Sequence[Bundle],
) -> Column:
    """Return the likeliest of columns that no name tells apart, in all files that have them.

    Of two, the load does work on the motion, as a joint takes energy; of more, it jumps and is rough.
    """
    moving = [c for c in free if c.role not in OTHERS and np.ptp(c.values) > 0]
    open_ones = [c for c in moving if c.role in (None, "position", "command")]
    needed = 2 if quantity == "moment" and not any(c.role for c in moving) else 1
    if len(open_ones) < needed:
        raise _missing(bundle, key)
    many = [[peer.find(str(column.key)) for column in open_ones] for peer in alike]
    whole = [[column.values for column in run if column is not None] for run in many if None not in run]
    rough = np.mean([[_roughness(values) for values in run] for run in whole], axis=0)
    if len(open_ones) == 2 and quantity == "moment":
        work = sum(_work(*run) for run in whole)
        rough = np.array([work, -work])
    guess = open_ones[int(np.argmax(rough) if quantity == "moment" else np.argmin(rough))]
    guess = _measured([c for c in open_ones if c is guess or is_twin(c.values, guess.values)])
    dialogue.ask(key, f"which column is the {key.replace('_', ' ')} ({_list(open_ones)})?", str(guess.key))
    return guess


def _missing(bundle: Bundle, key: str) -> InputError:
    """Return what a run holds instead of a column for a channel, and what to do."""
    names = ", ".join(f"{c.title} ({c.role})" if c.role else c.title for c in bundle.columns)
    refused = f" ({'; '.join(bundle.refused)})" if bundle.refused else ""
    said = f"{bundle.name}: holds no column for the {key}{refused}; columns there: {names}"
    other, arm = LEVERS[key]
    at_arm = next((column for column in bundle.columns if column.role == other), None)
    none = {"moment": NO_LOAD["rotation"], "force": NO_LOAD["translation"]}.get(key)
    if at_arm is not None:
        set_it = f"--set {key}={str(at_arm.key)!r} --set {key}.unit={at_arm.unit or '...'!r} --set {key}.gain={arm!r}"
        said += f"; where a lever makes it of the {other}, give its length: {set_it}"
    elif none:
        said += f"; where it was zero, as in a free decay, set {key}='{none}'"
    elif any(column.role in ("velocity", "angular rate") for column in bundle.columns):
        said += f"; a rate leaves the {key} open: add a column with its integral, or an acceleration"
    return InputError(said)


def _list(columns: Sequence[Column]) -> str:
    return ", ".join(str(column.key) for column in columns)


def _measured(candidates: Sequence[Column]) -> Column:
    """Return the measured one of a signal and its command: the rougher one; the first of signals that differ."""
    twins = [candidates[0], *(c for c in candidates[1:] if is_twin(c.values, candidates[0].values))]
    return max(twins, key=lambda column: _roughness(column.values))


def _work(load: Array, motion: Array) -> float:
    """Return the work of a load on a motion, in units of their spreads."""
    size = float(np.std(load) * np.std(motion)) * load.size
    return float(np.sum((load[1:] + load[:-1]) / 2 * np.diff(motion))) / size if size > 0 else 0.0


def _roughness(values: Array) -> float:
    """Return the size of second differences relative to the whole: what a derivative would make of the signal."""
    spread = float(np.std(values))
    return float(np.std(np.diff(values, 2))) / spread if spread > 0 else 0.0


def find_unit(
    column: Column, quantity: str, motion: Motion, dialogue: Dialogue, peers: Sequence[Column]
) -> tuple[str, str | None]:
    """Return unit and gain of a channel, stated or asked for.

    A unit that no file states is one for all runs: that in which the largest of their values is usual. Where some state
    theirs, the answer is that of the others.
    """
    key, si = KEYS[motion][quantity]
    counted = WORDS["counter"] & {word.lower() for word in re.split(r"[\W_]+", column.title)}
    stated = column.unit or (COUNTS[-1] if counted else "")
    told = [bool(peer.unit and unit_ratio(peer.unit, si)) for peer in (column, *peers)]
    if f"{key}.unit" in dialogue.answers and told[0] == all(told):
        unit: str = dialogue.answers[f"{key}.unit"]
    elif told[0]:
        return column.unit, None
    elif quantity == "acceleration" and (column.unit == "g" or unit_ratio(column.unit or "1", "m/s**2")):
        text = f"one over the radius at which the acceleration (column {column.key}) is measured, such as '5 rad/m'?"
        return column.unit, dialogue.ask(f"{key}.gain", text, None) if motion == "rotation" else None
    elif stated and needs_gain(stated):
        unit = stated
    else:
        largest = max(float(np.abs(peer.values).max()) for peer in peers)
        runs = f" in {len(peers)} runs" if len(peers) > 1 else ""
        text = (
            f"in which unit is the {key.replace('_', ' ')} (column {column.key}, up to {largest:.3g}{runs})?"
        ) + (f" The file states {stated!r}" if stated else "")
        # The unit among the words of a name, which may as well mean another thing, as in angle_rad_from_rest; else the
        # one in which values of this size are usual.
        words = [word for word in re.split(r"[\W_]+", column.title) if word in KNOWN | {"g"} and word != "in"]
        usual = {"rad": "deg" if largest > 0.5 else "rad", "m": "mm" if largest > 0.5 else "m"}
        guess = next((word for word in words if unit_ratio(word, si)), usual.get(si, si.replace("**", "^")))
        # A unit that is stated, and unknown or of another kind, is no reason for a guess.
        unit = dialogue.ask(f"{key}.unit", text, None if stated else guess) or guess
    gain = dialogue.answers.get(f"{key}.gain")
    if gain is None and needs_gain(unit):
        one = "count" if unit in COUNTS else "volt"
        example = f"35.15 {EXAMPLES.get(key, 'unit')}/{'V' if one == 'volt' else one}"
        gain = dialogue.ask(f"{key}.gain", f"what is one {one} of the {key}, such as '{example}'?", None)
    return unit, gain
