"""What a batch keeps of one campaign: a small record with its model, and a hash that shows whether it still holds."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from sindyjoint.equation.catalogue import Catalogue, as_catalogue
from sindyjoint.errors import SindyJointError
from sindyjoint.files.manifest import read_manifest

SCHEMA = 1
RECORD_FILE = "record.json"
MODEL_FILE = "model.json"
FACTORS_FILE = "factors.npz"
# Without these a campaign is not done, whatever its record says.
REQUIRED = frozenset({MODEL_FILE, FACTORS_FILE})


@dataclass(frozen=True)
class CampaignRecord:
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
        SHA-256 of every other file in the folder.
    extras : list of str
        What was written beyond model and factors.
    earlier : dict or None
        Of a broken campaign: the record of the last result, whose files are still in the folder.
    """

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

    def to_json(self) -> str:
        """Return the record as the text of ``record.json``."""
        data = {"schema": SCHEMA, **asdict(self)}
        return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


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
    files = [(run.file, _hash_file(path.parent / run.file)) for run in content.run]
    known = {
        "manifest": _hash_file(path),
        "files": files,
        "options": {name: repr(value) for name, value in sorted(options.items())},
        "library": _list_catalogue_text(as_catalogue(library)),
        "version": version,
    }
    return hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()


def _list_catalogue_text(catalogue: Catalogue) -> list[str]:
    return [repr((t.id, t.symbol, t.formula, t.unit, t.name, t.family, t.parameters)) for t in catalogue]


def last_result(folder: Path) -> CampaignRecord | None:
    """Return the record of the last result in a campaign's folder, also where later attempts at it were broken."""
    try:
        data = json.loads((folder / RECORD_FILE).read_text(encoding="utf-8"))
        if data.pop("schema") != SCHEMA:
            return None
        record = CampaignRecord(**data)
        if record.status == "broken":
            record = CampaignRecord(**(record.earlier or {}))
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None
    return record if isinstance(record.outputs, dict) and isinstance(record.extras, list) else None


def is_valid(record: CampaignRecord, folder: Path, inputs: str) -> bool:
    """Return whether a result still holds: of the same inputs, nothing missing, and every file as it was written."""
    if record.inputs != inputs or not set(record.outputs) >= REQUIRED:
        return False
    return all(_hash_file(folder / name) == digest for name, digest in record.outputs.items())


def hashes(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every file in a folder, by its path within."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): _hash_file(path) for path in files}


def _hash_file(path: Path) -> str:
    """Return the hash of a file, read in pieces; "missing" where there is none."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return "missing"


def broken(id: str, manifest: str, error: BaseException | str, inputs: str = "") -> CampaignRecord:
    """Return the record of a campaign that cannot be used, the reason in one line."""
    known = isinstance(error, SindyJointError | str)
    text = str(error) if known else f"unexpected {type(error).__name__}: {error}"
    return CampaignRecord(id, manifest, "broken", " ".join(text.split()), inputs=inputs)
