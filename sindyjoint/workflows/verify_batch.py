"""A finished batch held against its inputs and its hashes."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from sindyjoint.batch.record import changed_outputs, fingerprint, read_record
from sindyjoint.checksums import changed_files
from sindyjoint.errors import InputError, SindyJointError
from sindyjoint.workflows.batch import Task, Writer, extras_of, find_tasks


def verify_batch(
    campaigns: str | Path | Sequence[str | Path],
    out: str | Path,
    library: Any = "extended",
    *,
    write: Writer | None = None,
    **options: Any,
) -> tuple[tuple[str, str], ...]:
    """Hold a finished batch against its inputs and its hashes; nothing is written.

    Parameters are those of :func:`batch`.

    Returns
    -------
    tuple of (str, str)
        Campaign, and what keeps its result from being taken for done: files missing or changed, inputs, options,
        catalogue or version other than those it was made from. An empty name stands for the batch itself.

    Raises
    ------
    MissingInputError
        If there is no campaign.
    """
    faults: list[tuple[str, str]] = []
    for task in find_tasks(campaigns, Path(out), library, options, write):
        faults += [(task.id, fault) for fault in _find_faults(task)]
    try:
        faults += [("", fault) for fault in changed_files(Path(out))]
    except InputError as error:
        faults.append(("", str(error)))
    return tuple(faults)


def _find_faults(task: Task) -> list[str]:
    """Return what keeps the result of a campaign from being taken for done."""
    try:
        record = read_record(task.folder)
        if record.status == "broken":
            return [f"broken: {record.reason}"]
        inputs = fingerprint(task.manifest, task.options, task.library, version("sindyjoint"))
    except SindyJointError as error:
        return [str(error)]
    faults = changed_outputs(record, task.folder)
    faults += [] if record.inputs == inputs else ["was made from other files, options, catalogue or version"]
    missing = sorted(set(extras_of(task)) - set(record.extras))
    return faults + ([f"has no {', '.join(missing)}"] if missing else [])
