"""What each column of some files is taken for, and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from sindyjoint.files.drafting.bundles import Bundle, Column
from sindyjoint.files.drafting.dialogue import Dialogue
from sindyjoint.text import list_some

UNUSED = "not used"


@dataclass(frozen=True)
class UsedColumn:
    """A column of a draft.

    Parameters
    ----------
    file : str
        Or files, where it is the same in several.
    column : str, int or None
        Its name or number; None of what no column holds.
    quantity : str
        Key of the channel, or ``"not used"``.
    unit : str
        Or the value of a constant, or the sampling rate.
    why : str
    """

    file: str
    column: str | int | None
    quantity: str
    unit: str
    why: str

    @classmethod
    def of_time(
        cls, bundle: Bundle, column: Column | None, channels: dict[str, str], dialogue: Dialogue
    ) -> UsedColumn:
        """Return how a run was sampled, by its channels."""
        if column is not None and "column" in channels.get("time", ""):
            unit = dialogue.answers.get("time.unit") or column.unit
            return cls(
                bundle.name,
                column.key,
                "time",
                unit or "s",
                why_column(column, "time", unit or "s", dialogue),
            )
        value, _, comment = channels.get("rate", channels.get("time", '"?"')).partition("  # ")
        why = dialogue.why("rate", comment or "stamps")
        return cls(bundle.name, None, "rate" if "rate" in channels else "time", value.strip('"'), why)

    @classmethod
    def unused(cls, file: str, column: Column) -> UsedColumn:
        """Return a column that is none of the channels."""
        why = f"looks like {column.role}" if column.role else "neither name nor unit tell"
        return cls(file, column.key, UNUSED, column.unit, why)


def why_column(column: Column, key: str, unit: str, dialogue: Dialogue) -> str:
    """Return why a column is a channel, and in that unit."""
    by_file = "its name" if column.role else "its values"
    of_unit = "the file" if column.unit and column.unit == unit else "its size"
    return f"column: {dialogue.why(key, by_file)}; unit: {dialogue.why(f'{key}.unit', of_unit)}"


def list_used(runs: Sequence[Sequence[UsedColumn]]) -> tuple[UsedColumn, ...]:
    """Return the columns of runs, those that are the same in several as one; the unused ones last."""
    same: dict[UsedColumn, list[str]] = {}
    for used in (column for run in runs for column in run):
        same.setdefault(replace(used, file=""), []).append(used.file)
    merged = [
        replace(used, file=f"all {len(files)}" if len(files) == len(runs) > 1 else list_some(files, "files"))
        for used, files in same.items()
    ]
    return tuple(sorted(merged, key=lambda used: used.quantity == UNUSED))
