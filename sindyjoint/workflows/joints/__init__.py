"""Many joints: the campaigns of a batch, found below a folder or by a pattern, and what is kept of each.

Each has a harmless name of its own, and a small record with its model and a hash that shows whether it still holds.
"""

import glob
import hashlib
import json
import os
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from sindyjoint.described import Described, same
from sindyjoint.documents import hash_file, list_changes, parse_json, read_regular
from sindyjoint.equation.catalogue import as_catalogue
from sindyjoint.errors import InputError, MissingInputError, SindyJointError
from sindyjoint.files.manifest import MANIFEST_NAME, read_manifest

RECORD_FILE = "record.json"
MODEL_FILE = "model.json"
FACTORS_FILE = "factors.npz"
CAMPAIGNS = "campaigns"
# Bytes of a campaign's name: with what stands before and behind it, file systems take 255.
LONGEST_ID = 80
# What puts further files of a discovery into a campaign's folder.
Writer = Callable[[Any, Path], None]
# Without these a campaign is not done, whatever its record says.
REQUIRED = frozenset({MODEL_FILE, FACTORS_FILE})


@dataclass(frozen=True)
class CampaignRecord(Described):
    """One campaign of a batch.

    Parameters
    ----------
    id : str
        Name of its folder of results.
    manifest : str
        Its ``campaign.toml``, from the folder that was searched.
    status : {"found", "none", "broken"}
        A model was found; none was; the campaign could not be read or used.
    reason : str
        How the terms were chosen, why none was, or what is wrong.
    joint : dict
        Name, motion, inertia, temperature (K), serial and labels as declared; empty for a broken campaign.
    result : dict or None
        What ``sindyjoint discover --json`` prints.
    inputs : str
        Hash of manifest, run files, options and version; empty where they cannot be read.
    outputs : dict of str to str
        SHA-256 of every other file in the folder; ``SHA256SUMS`` lists the same.
    extras : list of str
        What was written beyond model and factors.
    earlier : dict or None
        Of a broken campaign: the record of the last result, whose files are still in the folder.
    """

    SCHEMA: ClassVar = 2
    WRITTEN: ClassVar = same(
        *("id", "manifest", "status", "reason", "joint", "result", "inputs", "outputs", "extras", "earlier"),
    )
    FILED: ClassVar = same("checksum")
    id: str
    manifest: str
    status: str
    reason: str
    joint: dict[str, Any] = field(default_factory=dict)
    result: dict[str, Any] | None = None
    inputs: str = ""
    outputs: dict[str, str] = field(default_factory=dict)
    extras: list[str] = field(default_factory=list)
    earlier: dict[str, Any] | None = None

    @property
    def terms(self) -> dict[str, dict[str, Any]]:
        """Terms of the model by id."""
        return {term["id"]: term for term in self.result["terms"]} if self.result else {}

    @property
    def checksum(self) -> str:
        """SHA-256 of the content."""
        return _checksum(self.to_dict())

    def to_json(self) -> str:
        """Return the record as the text of ``record.json``, with a checksum of its content."""
        return json.dumps(self.to_dict(full=True), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _checksum(content: Mapping[str, Any]) -> str:
    """Return the SHA-256 of JSON data, whatever way it is laid out."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def fingerprint(manifest: Path, options: Mapping[str, Any], library: Any, version: str) -> str:
    """Return a hash of everything that a campaign's result depends on.

    Parameters
    ----------
    manifest : Path
    options : mapping
        Of :func:`~sindyjoint.workflows.discover.discover`; JSON values.
    library : str, Path, Catalogue, or sequence of these
        Hashed by what it holds, not by its name.
    version : str
        Of this package.

    Raises
    ------
    SindyJointError
        When manifest or catalogue cannot be read.
    """
    path, content = read_manifest(manifest)
    files = [(run.file, hash_file(path.parent / run.file)) for run in content.run]
    known = {
        "manifest": hash_file(path),
        "files": files,
        "options": {name: repr(value) for name, value in sorted(options.items())},
        "library": [
            repr((t.id, t.symbol, t.formula, t.unit, t.name, t.family, t.parameters))
            for t in as_catalogue(library)
        ],
        "version": version,
    }
    return hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()


def last_result(folder: Path) -> CampaignRecord | None:
    """Return the record of the last result in a campaign's folder, also where later attempts at it were broken."""
    try:
        record = read_record(folder)
        return CampaignRecord(**(record.earlier or {})) if record.status == "broken" else record
    except (InputError, TypeError):
        return None


def read_record(folder: Path) -> CampaignRecord:
    """Return the record in a campaign's folder.

    Raises
    ------
    InputError
        Where there is none, or it is not as it was written.
    """
    path = folder / RECORD_FILE
    try:
        data = parse_json(read_regular(path).decode("utf-8"), str(path))
        given = data.pop("checksum")
        if data["schema"] != CampaignRecord.SCHEMA or given != _checksum(data):
            raise InputError(
                f"{path}: is not as it was written (its checksum is another); run the batch again"
            )
        del data["schema"]
        return CampaignRecord(**data)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: is no record of a campaign; run the batch again") from None


def changed_outputs(record: CampaignRecord, folder: Path) -> list[str]:
    """Return which files of a result, those that it must have among them, are missing or changed, a sentence each."""
    return sorted(list_changes(folder, dict.fromkeys(REQUIRED, "") | record.outputs))


def broken(id: str, manifest: str, error: BaseException | str, inputs: str = "") -> CampaignRecord:
    """Return the record of a campaign that cannot be used, the reason in one line."""
    known = isinstance(error, SindyJointError | str)
    text = str(error) if known else f"unexpected {type(error).__name__}: {error}"
    return CampaignRecord(id, manifest, "broken", " ".join(text.split()), inputs=inputs)


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
    return [
        Task(id, label, path, out / CAMPAIGNS / id, library, dict(options), write)
        for id, (path, label) in zip(ids, ordered, strict=True)
    ]


def _manifests(pattern: str, out: Path) -> Iterator[tuple[Path, str]]:
    """Yield manifests that a folder or pattern leads to, each with a label that does not depend on the others."""
    if os.path.isdir(pattern):
        base, starts = Path(pattern), [Path(pattern)]
    else:
        # What stands before the first wildcard is the same for all and no part of a name.
        head = re.split(r"[*?\[]", pattern, maxsplit=1)[0]
        base = Path(head if head.endswith(("/", os.sep)) else os.path.dirname(head))
        starts = [Path(name) for name in sorted(glob.glob(pattern, recursive=True))]
    results = out.resolve() if out.exists() else out
    for start in starts:
        found = sorted(start.rglob(MANIFEST_NAME)) if start.is_dir() else [start] * (start.suffix == ".toml")
        for path in (path for path in found if results not in path.resolve().parents):
            inside = Path(os.path.relpath(path, base))
            # The manifest of the searched folder itself goes by the folder's name.
            own = inside.parent == Path()
            yield path, f"{path.resolve().parent.name}/{inside}" if own else inside.as_posix()


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
    digest = hashlib.sha256(label.encode(errors="surrogateescape")).hexdigest()[:12]
    return f"{name.encode()[: LONGEST_ID - 1 - len(digest)].decode(errors='ignore')}-{digest}"
