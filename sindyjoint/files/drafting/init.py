"""From a folder of files to its ``campaign.toml``."""

import shlex
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import ClassVar

from sindyjoint.described import Described, same
from sindyjoint.documents import parse_toml
from sindyjoint.errors import InputError, OutputError, checks_options
from sindyjoint.files.atomic import write_text
from sindyjoint.files.drafting.assignment import Question
from sindyjoint.files.drafting.draft import Draft, DraftedRun, draft_manifest
from sindyjoint.files.drafting.survey import survey_folder
from sindyjoint.files.manifest import MANIFEST_NAME, Channel, Manifest, TimeChannel
from sindyjoint.text import in_columns


@dataclass(frozen=True)
class Initialised(Described):
    """The result of :func:`init`.

    Parameters
    ----------
    manifest : Path
        What was written.
    draft : Draft
        What it says, and what of it is guessed.
    kept : dict of str to str
        Answers that stood in the manifest that was replaced, by the keys of questions.
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {
        "manifest": "manifest",
        **{name: f"draft.{name}" for name in ("motion", "simulated", "channels", "columns", "runs")},
        **same("guessed", "left_out", "kept"),
    }
    manifest: Path
    draft: Draft
    kept: dict[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        return "\n".join(self.lines())

    __repr__ = __str__

    def lines(self) -> list[str]:
        """Return what was found, in a line for each thing."""
        draft = self.draft
        kind = "simulated runs" if draft.simulated else "runs"
        rows = [("file", "column", "quantity", "unit", "why")] + [
            (u.file, "–" if u.column is None else str(u.column), u.quantity, u.unit or "–", u.why)
            for u in draft.columns[:SHOWN]
        ]
        runs = f" for all {len(draft.runs)} runs" if len(draft.runs) > 1 else ""
        guesses = ((each.key, each.guess) for each in draft.questions[: SHOWN // 2])
        return [
            f"{self.manifest}: {len(draft.runs)} {kind}, {draft.motion}",
            *(f"  {line}" for line in in_columns(rows)),
            *_more(draft.columns, " columns"),
            *(f"  {self._said_of(run)}" for run in draft.runs[:SHOWN]),
            *_more(draft.runs, ""),
            *(f"  left out: {file}: {why:.90}" for file, why in draft.left_out[: SHOWN // 2]),
            *(f"  kept: {key} = {value}; --set {key}=... changes it" for key, value in self.kept.items()),
            *(f"  guessed: {key} = {guess}{runs}; --set {key}=... sets it" for key, guess in guesses),
        ]

    def _said_of(self, run: DraftedRun) -> str:
        rate = "" if run.rate is None else f" at {run.rate:.6g} Hz"
        alike = sum((run.frequency, run.level) == (each.frequency, each.level) for each in self.draft.runs)
        again = f", one of {alike} that repeat" if alike > 1 and run.frequency else ""
        called = f"{run.file} {run.run}".strip()
        return f"{called}: {run.samples} samples{rate}, {run.course}, level {run.level}{again}"

    @property
    def guessed(self) -> dict[str, str | None]:
        """What was guessed, by the keys of questions."""
        return {question.key: question.guess for question in self.draft.questions}

    @property
    def left_out(self) -> dict[str, str]:
        """Files that are no runs, and why."""
        return dict(self.draft.left_out)


SHOWN = 16


def _more(items: Sequence[object], what: str) -> list[str]:
    return [f"  and {len(items) - SHOWN} more{what}"] if len(items) > SHOWN else []


@checks_options()
def init(
    folder: str | Path,
    answers: Mapping[str, str] | None = None,
    *,
    ask: Callable[[Question], str] | None = None,
    guess: bool = True,
    force: bool = False,
) -> Initialised:
    """Write a ``campaign.toml`` for the data files of a folder.

    Columns and units come from headers, rows of units and names, the rate from the time column or what stands above it,
    frequencies from spectra, levels from file names and amplitudes.

    Parameters
    ----------
    folder : path-like
    answers : mapping of str to str, optional
        What the files do not say, or say otherwise: ``{"angle.unit": "mrad", "rate": "1 kHz"}``.
    ask : callable, optional
        Called with each question that is left; returns the answer.
    guess : bool
        Whether questions that are left are answered by the likeliest guess, marked in the file.
    force : bool
        Whether a ``campaign.toml`` that is there may be replaced. What it says otherwise than the files is kept, as far
        as ``answers`` can say it and say nothing else.

    Returns
    -------
    Initialised

    Raises
    ------
    MissingInputError
        When there is no such folder or no data file in it.
    InputError
        When no file holds a run, or a question stays open.
    OutputError
        When there is a ``campaign.toml`` already.

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, out="tests", rng=0)
    >>> from pathlib import Path
    >>> Path("tests/campaign.toml").unlink()
    >>> sindyjoint.init("tests").manifest
    PosixPath('tests/campaign.toml')
    """
    place = Path(folder)
    target = place / MANIFEST_NAME
    if target.exists() and not force:
        raise OutputError(f"{target}: is there already; give --force (force=True) to replace it")
    files, left_out = survey_folder(place)
    given, kept = dict(answers or {}), dict[str, str]()
    name = place.resolve().name

    def draft(answers: Mapping[str, str]) -> Draft:
        try:
            return draft_manifest(name, files, left_out, answers)
        except InputError as error:
            said = ", ".join(f"{key} = {value!r}" for key, value in kept.items())
            way = f"; {target} says {said}: change it with --set, or remove that file" * bool(kept)
            raise InputError(f"{place}: {error}{way}") from error

    if target.exists():
        kept = _kept(target, draft, given)
    given = kept | given
    drafted = draft(given)
    question: Question | None = None
    while ask is not None and drafted.questions:
        # An answer may bring up other questions, or settle them; a wrong one is asked for again, the others stay.
        asked = question or drafted.questions[0]
        answer = ask(asked)
        try:
            drafted = draft(given | {asked.key: answer})
            given[asked.key], question = answer, None
        except InputError as error:
            if asked.complaint == str(error):
                raise
            question = replace(asked, complaint=str(error))
    # Without a guess any answer would be invented.
    open_ones = [each for each in drafted.questions if each.guess is None or not guess]
    if open_ones:
        listed = "; ".join(f"{each.key}: {each.text}" for each in open_ones)
        if any(each.key.endswith(".unit") for each in open_ones):
            listed += " (of volts and counts, KEY.gain too)"
        ways = "answer with --set (answers in Python)" + (
            ""
            if guess or any(each.guess is None for each in open_ones)
            else ", or take the guesses with --yes"
        )
        values = given | {each.key: each.guess or "..." for each in open_ones}
        settings = (f"--set {shlex.quote(f'{key}={value}')}" for key, value in values.items())
        raise InputError(
            f"{place}: the files do not tell all: {listed} {ways}: "
            f"{' '.join(['sindyjoint', 'init', shlex.quote(str(place)), *settings, *['--force'] * force])}"
        )
    return Initialised(write_text(target, drafted.text), drafted, kept)


def _answers_in(manifest: str) -> dict[str, set[str | None]]:
    """Return what a manifest says, of any of its runs, by the keys of questions, without its guesses."""
    read = Manifest.model_validate(parse_toml(manifest, MANIFEST_NAME))
    said = defaultdict[str, set[str | None]](set)
    for key in read.joint.model_fields_set & {"name", "motion", "inertia", "mass"}:
        said[key].add(getattr(read.joint, key))
    own = {run.file: read.channels.overridden_by(run.channels) for run in read.run}
    stated = {file: "none" if channels.time == "none" else channels.rate for file, channels in own.items()}
    rates = {file: f"{rate} Hz" if isinstance(rate, float) else rate for file, rate in stated.items()}
    several = len(set(rates.values())) > 1
    each = ", ".join(f"{file}: {rate}" for file, rate in rates.items() if rate)
    said["rate"] |= {each} if several else set(rates.values())
    for channels in filter(None, (read.channels, *(run.channels for run in read.run))):
        for key, given in channels:
            if isinstance(given, Channel):
                said[key].add(given.constant or " - ".join(map(str, given.columns)))
                said[f"{key}.gain"].add(given.gain)
            if isinstance(given, TimeChannel):
                said[key].add(str(given.column))
            if isinstance(given, Channel | TimeChannel):
                said[f"{key}.unit"].add(given.unit)
    kept = [
        run.name or str(PurePosixPath(run.file).with_suffix("")) for run in read.run if run.use == "validate"
    ]
    said["validate"].add(", ".join(kept))
    said["inputs"].add(", ".join(str(each.column) for each in read.inputs.values() if each.column))
    said["runs"].add("no" if len({run.file for run in read.run}) == len(read.run) else "yes")
    return {
        key: values
        for key, values in said.items()
        if not any(g.startswith(f"{key} = ") for g in read.guessed)
    }


def _kept(
    target: Path, draft: Callable[[Mapping[str, str]], Draft], given: Mapping[str, str]
) -> dict[str, str]:
    """Return what a manifest says of all its runs that neither the files nor other answers do; of none, nothing."""
    told: dict[str, set[str | None]] = {}
    with suppress(InputError):
        told = _answers_in(draft({}).text)
    try:
        said = _answers_in(target.read_text(encoding="utf-8"))
    except ValueError:
        return {}
    of_all = {key: next(iter(values)) for key, values in said.items() if len(values) == 1}
    own = {key: value for key, value in of_all.items() if value and value not in told.get(key, ())}
    kept = {}
    for key, value in own.items():
        channel = key.partition(".")[0]
        # Another column has another unit, another unit another gain.
        above = {key, channel, key.replace(".gain", ".unit")}
        same = channel in own or key not in told or told[channel] <= said[channel]
        if same and not above & given.keys():
            kept[key] = value
    return kept
