"""From a folder of files to its ``campaign.toml``."""

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

from sindyjoint.described import Described, same
from sindyjoint.errors import InputError, OutputError, checks_options
from sindyjoint.files.atomic import write_text
from sindyjoint.files.drafting.assignment import Question
from sindyjoint.files.drafting.draft import Draft, draft_manifest
from sindyjoint.files.drafting.survey import survey_folder
from sindyjoint.files.manifest import MANIFEST_NAME


@dataclass(frozen=True)
class Initialised(Described):
    """The result of :func:`init`.

    Parameters
    ----------
    manifest : Path
        What was written.
    draft : Draft
        What it says, and what of it is guessed.
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {
        "manifest": "manifest",
        **{name: f"draft.{name}" for name in ("motion", "simulated", "channels", "columns", "runs")},
        **same("guessed", "left_out"),
    }
    manifest: Path
    draft: Draft

    def __str__(self) -> str:
        return "\n".join(self.lines())

    __repr__ = __str__

    def lines(self) -> list[str]:
        """Return what was found, in a line for each thing."""
        draft = self.draft
        kind = "simulated runs" if draft.simulated else "runs"
        lines = [f"{self.manifest}: {len(draft.runs)} {kind}, {draft.motion}"]
        rows = [("file", "column", "quantity", "unit", "why")] + [
            (u.file, "–" if u.column is None else str(u.column), u.quantity, u.unit or "–", u.why)
            for u in draft.columns[:SHOWN]
        ]
        wide = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines += ["  " + "  ".join(map(str.ljust, row, wide)).rstrip() for row in rows]
        lines += _more(draft.columns, " columns")
        kinds = [(run.frequency, run.level) for run in draft.runs]
        for run in draft.runs[:SHOWN]:
            rate = "" if run.rate is None else f" at {run.rate:.6g} Hz"
            repeated = kinds.count((run.frequency, run.level))
            again = f", one of {repeated} that repeat" if repeated > 1 and run.frequency else ""
            called = f"{run.file} {run.run}".strip()
            lines.append(f"  {called}: {run.samples} samples{rate}, {run.course}, level {run.level}{again}")
        lines += _more(draft.runs, "")
        lines += [f"  left out: {file}: {why:.90}" for file, why in draft.left_out[: SHOWN // 2]]
        runs = f" for all {len(draft.runs)} runs" if len(draft.runs) > 1 else ""
        for each in draft.questions[: SHOWN // 2]:
            lines.append(f"  guessed: {each.key} = {each.guess}{runs}; --set {each.key}=... sets it")
        return lines

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
        Whether a ``campaign.toml`` that is there may be replaced.

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
    given = dict(answers or {})
    name = place.resolve().name

    def draft(answers: Mapping[str, str]) -> Draft:
        try:
            return draft_manifest(name, files, left_out, answers)
        except InputError as error:
            raise InputError(f"{place}: {error}") from error

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
            f"{' '.join(['sindyjoint', 'init', shlex.quote(str(place)), *settings])}"
        )
    return Initialised(write_text(target, drafted.text), drafted)
