"""What a batch keeps of one campaign: a small record with its model, and a hash that shows whether it still holds."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from sindyjoint.described import Described, same
from sindyjoint.documents import hash_file, list_changes, parse_json, read_regular
from sindyjoint.equation.catalogue import as_catalogue
from sindyjoint.errors import InputError, SindyJointError
from sindyjoint.files.manifest import read_manifest

RECORD_FILE = "record.json"
MODEL_FILE = "model.json"
FACTORS_FILE = "factors.npz"
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


def is_valid(record: CampaignRecord, folder: Path, inputs: str) -> bool:
    """Return whether a result still holds: of the same inputs, nothing missing, and every file as it was written."""
    if record.inputs != inputs or not set(record.outputs) >= REQUIRED:
        return False
    return not changed_outputs(record, folder)


def changed_outputs(record: CampaignRecord, folder: Path) -> list[str]:
    """Return which files of a result are missing or changed, a sentence each."""
    return sorted(list_changes(folder, dict.fromkeys(REQUIRED, "") | record.outputs))


def broken(id: str, manifest: str, error: BaseException | str, inputs: str = "") -> CampaignRecord:
    """Return the record of a campaign that cannot be used, the reason in one line."""
    known = isinstance(error, SindyJointError | str)
    text = str(error) if known else f"unexpected {type(error).__name__}: {error}"
    return CampaignRecord(id, manifest, "broken", " ".join(text.split()), inputs=inputs)
