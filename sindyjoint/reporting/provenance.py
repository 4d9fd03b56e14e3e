"""Where a result came from: input files with hashes, versions, seed, command line."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sindyjoint.documents import hash_file, read_toml
from sindyjoint.judgement.versions import versions
from sindyjoint.record import Campaign


@dataclass(frozen=True)
class Provenance:
    """What one needs to make a result again.

    Parameters
    ----------
    command_line : str
        Empty where the result was made from Python.
    seed : str
    made : str
        Date and time, UTC.
    versions : tuple of (str, str)
    inputs : tuple of (str, str, str)
        Run, file, SHA-256; the latter two empty for runs that come from no file.
    notes : tuple of str
    """

    command_line: str
    seed: str
    made: str
    versions: tuple[tuple[str, str], ...]
    inputs: tuple[tuple[str, str, str], ...]
    notes: tuple[str, ...] = ()


def provenance(
    campaign: Campaign | None = None,
    seed: object = None,
    command_line: str | Sequence[str] | None = None,
    files: Sequence[str | os.PathLike[str]] = (),
) -> Provenance:
    """Return the provenance of a result that is made now.

    Parameters
    ----------
    campaign : Campaign, optional
        Its runs name the files that they come from.
    seed : object
    command_line : str or sequence of str, optional
    files : sequence of path
        Further files that were read, such as a model or a rig; folders stand for the manifest or model in them.
    """
    return Provenance(
        command_line=_line(command_line),
        seed=_seed(seed),
        made=f"{str(np.datetime64('now', 's')).replace('T', ' ')} UTC",
        versions=versions(),
        inputs=(
            *(
                (run.name, run.source.path if run.source else "", run.source.sha256 if run.source else "")
                for run in (campaign.runs if campaign else ())
            ),
            *(entry for file in files for entry in _hashed(Path(file))),
        ),
        notes=campaign.notes if campaign else (),
    )


def _hashed(path: Path) -> list[tuple[str, str, str]]:
    """Return stem, name and SHA-256 of a file; of a campaign's manifest, of its run files too."""
    if path.is_dir():
        path = next(
            (path / name for name in ("campaign.toml", "rig.toml", "model.json") if (path / name).is_file()),
            path,
        )
    if not path.is_file():
        return []
    listed = [path]
    if path.suffix == ".toml":
        for run in read_toml(path).get("run", []):
            if isinstance(run, dict) and "file" in run:
                exact = path.parent / run["file"]
                listed += [exact] if exact.is_file() else sorted(path.parent.glob(run["file"]))
    return [(one.stem, one.name, hash_file(one)) for one in listed if one.is_file()]


def _line(command_line: str | Sequence[str] | None) -> str:
    if command_line is None:
        return ""
    if isinstance(command_line, str):
        return command_line
    import shlex

    return shlex.join(command_line)


def _seed(seed: object) -> str:
    if seed is None:
        return "none given"
    return str(seed) if isinstance(seed, int | np.integer) else "a generator of the caller's"
