"""The campaigns of a batch: found below a folder or by a pattern, each with a harmless name of its own."""

from __future__ import annotations

import glob
import os
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sindyjoint.errors import MissingInputError
from sindyjoint.files.manifest import MANIFEST_NAME

CAMPAIGNS = "campaigns"
# Bytes of a campaign's name: with what stands before and behind it, file systems take 255.
LONGEST_ID = 80
# What puts further files of a discovery into a campaign's folder.
Writer = Callable[[Any, Path], None]


@dataclass(frozen=True)
class Task:
    """One campaign to do.

    Parameters
    ----------
    id : str
        Of its folder of results.
    label : str
        Its manifest as records name it.
    manifest, folder : Path
        What to read, and where to write.
    library : as for :func:`~sindyjoint.workflows.discover.discover`
    options : mapping
        Further arguments of ``discover``.
    write : callable
        Fills a folder with a result.
    """

    id: str
    label: str
    manifest: Path
    folder: Path
    library: Any
    options: Mapping[str, Any] = field(default_factory=dict)
    write: Writer | None = None


def extras_of(task: Task) -> list[str]:
    """Return the names of what is requested beyond model and factors."""
    write = task.write
    if write is None:
        return []
    return list(getattr(write, "extras", None) or [getattr(write, "__qualname__", repr(write))])


def find_tasks(
    campaigns: str | Path | Sequence[str | Path],
    out: Path,
    library: Any,
    options: Mapping[str, Any],
    write: Writer | None = None,
) -> list[Task]:
    """Return the campaigns of a batch in the order of their names.

    Raises
    ------
    MissingInputError
        If nothing is there.
    """
    given = [campaigns] if isinstance(campaigns, str | Path) else list(campaigns)
    found: dict[Path, str] = {}
    for pattern in given:
        for path, label in _manifests(str(pattern), out):
            found.setdefault(path.resolve(), label)
    if not found:
        raise MissingInputError(
            f"no {MANIFEST_NAME} in {', '.join(repr(str(g)) for g in given)}; expected a folder that holds "
            "campaigns, or a pattern such as 'tests/*'"
        )
    ordered = sorted(found.items(), key=lambda item: item[1])
    ids = _make_ids([label for _, label in ordered])
    home = out / CAMPAIGNS
    return [
        Task(id, label, path, home / id, library, dict(options), write)
        for id, (path, label) in zip(ids, ordered, strict=True)
    ]


def _manifests(pattern: str, out: Path) -> list[tuple[Path, str]]:
    """Return manifests that a folder or pattern leads to, each with a label that does not depend on the others."""
    if os.path.isdir(pattern):
        base, starts = Path(pattern), [Path(pattern)]
    else:
        # What stands before the first wildcard is the same for all and no part of a name.
        head = re.split(r"[*?\[]", pattern, maxsplit=1)[0]
        base = Path(head if head.endswith(("/", os.sep)) else os.path.dirname(head))
        starts = [Path(name) for name in sorted(glob.glob(pattern, recursive=True))]
    results = out.resolve() if out.exists() else out
    paths = []
    for start in starts:
        paths += sorted(start.rglob(MANIFEST_NAME)) if start.is_dir() else [start] * (start.suffix == ".toml")
    labels = []
    for path in paths:
        if results in path.resolve().parents:
            continue
        inside = Path(os.path.relpath(path, base))
        # The manifest of the searched folder itself goes by the folder's name.
        labels.append(
            (path, inside.as_posix() if inside.parent != Path() else f"{path.resolve().parent.name}/{inside}")
        )
    return labels


def _make_ids(labels: Sequence[str]) -> list[str]:
    """Return a harmless name of a folder for every manifest, no two alike even where case does not count.

    A name that is cut, or that another campaign would have as well, ends in a hash of the manifest.
    """
    names = []
    for label in labels:
        path = Path(label)
        stem = path.parent if path.name == MANIFEST_NAME else path.with_suffix("")
        names.append(re.sub(r"[^\w.+=-]+", "-", stem.as_posix()).strip(".-") or "campaign")
    marked = {i for i, name in enumerate(names) if len(name.encode()) > LONGEST_ID}
    while True:
        ids = [_hashed(n, labels[i]) if i in marked else n for i, n in enumerate(names)]
        count = Counter(id.lower() for id in ids)
        alike = {i for i, id in enumerate(ids) if count[id.lower()] > 1} - marked
        if not alike:
            return ids
        marked |= alike


def _hashed(name: str, label: str) -> str:
    """Return a name, cut where it is too long, with a hash of a label behind it."""
    import hashlib

    digest = hashlib.sha256(label.encode(errors="surrogateescape")).hexdigest()[:12]
    return f"{name.encode()[: LONGEST_ID - 1 - len(digest)].decode(errors='ignore')}-{digest}"
