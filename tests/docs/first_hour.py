"""A newcomer's first hour: from a folder of files to a report, in three commands and without an edited line.

``python tests/docs/first_hour.py [FOLDER ...]`` walks it aloud, for each folder in turn; without folders, on a virtual
test whose manifest is deleted, on workbooks, on LabVIEW files, and on the public data that lie beside the checkout.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests" / "files"))  # the writers of odd folders
PUBLIC = ROOT.parent / "shared" / "data"
# What the files of public data do not tell: a person who has them knows it.
TOLD = {
    "emps": ("--set", "motion=translation", "--set", "force=vir", "--set", "force.unit=V",
             "--set", "force.gain=35.15065188 N/V", "--set", "displacement=qm", "--set", "displacement.unit=m"),
    "friction-damper": ("--set", "mass=0 kg"),
}  # fmt: skip


# Ends what a command said, where one process runs several, and its status behind that.
END = "\x1e"
IN_ONE = f"""
import json, sys
from sindyjoint.cli import main
for words in json.loads(sys.argv[1]):
    try:
        main(words)
    except SystemExit as leave:
        print({END!r}, int(leave.code or 0), {END!r}, sep="", end="", flush=True)
    print({END!r}, end="", file=sys.stderr)
"""


@dataclass(frozen=True)
class Answered:
    """What a command said."""

    command: str
    status: int
    stdout: str
    stderr: str


def commands(
    folder: Path, results: Path, told: Sequence[str] = (), quick: Sequence[str] = ()
) -> list[list[str]]:
    """Return the three commands of the hour."""
    return [
        ["init", str(folder), *told],
        ["check", str(folder)],
        ["discover", str(folder), "--out", str(results), *quick],
    ]


def walk(
    folder: Path,
    results: Path,
    told: Sequence[str] = (),
    env: Mapping[str, str] | None = None,
    quick: Sequence[str] = (),
) -> list[Answered]:
    """Type the commands, one after the other, and return what each said."""
    return [
        _typed([sys.executable, "-m", "sindyjoint"], words, env)
        for words in commands(folder, results, told, quick)
    ]


def walk_in_one(
    folder: Path, results: Path, env: Mapping[str, str] | None = None, quick: Sequence[str] = ()
) -> list[Answered]:
    """Type the commands in one new process, which loads its libraries once, and return what each said."""
    typed = commands(folder, results, quick=quick)
    whole = _typed([sys.executable, "-c", IN_ONE], [json.dumps(typed)], env)
    stdout, stderr = whole.stdout.split(END), whole.stderr.split(END)
    said = zip(typed, stdout[1::2], stdout[:-1:2], stderr[:-1], strict=True)
    return [
        Answered(" ".join(["sindyjoint", *words]), int(status), out, err) for words, status, out, err in said
    ]


def _typed(program: Sequence[str], words: Sequence[str], env: Mapping[str, str] | None) -> Answered:
    run = subprocess.run(
        [*program, *words],
        capture_output=True,
        text=True,
        encoding="utf-8",
        errors="replace",
        env={**os.environ, **(env or {})},
        stdin=subprocess.DEVNULL,
    )
    return Answered(" ".join(["sindyjoint", *words]), run.returncode, run.stdout, run.stderr)


def without_manifest(source: Path, folder: Path) -> Path:
    """Copy a folder of runs, but for what says how they are to be read."""
    shutil.copytree(source, folder, ignore=shutil.ignore_patterns("*.toml", "*.md"))
    return folder


def stages(place: Path) -> dict[str, tuple[Path, Sequence[str]]]:
    """Return the folders of the hour, and what is told about each."""
    from odd_folders import campaign, labview, workbook

    from sindyjoint.files import write_campaign

    truth = campaign()
    folders = {name: place / name for name in ("virtual", "workbooks", "labview")}
    write_campaign(truth, folders["virtual"]).unlink()
    for name, writer in (("workbooks", workbook), ("labview", labview)):
        folders[name].mkdir()
        writer(folders[name], truth)
    for name in ("friction-damper", "emps", "arm-joint"):
        if (PUBLIC / name).is_dir():
            folders[name] = without_manifest(PUBLIC / name, place / name)
    return {name: (folder, TOLD.get(name, ())) for name, folder in folders.items()}


def main() -> None:
    """Walk aloud."""
    with tempfile.TemporaryDirectory() as place:
        given = {name: (Path(name), ()) for name in sys.argv[1:]}
        for name, (folder, told) in (given or stages(Path(place))).items():
            for answer in walk(folder, Path(place) / f"{name}-results".replace("/", "-"), told):
                print(f"$ {answer.command}\n{answer.stdout}{answer.stderr}[status {answer.status}]\n")


if __name__ == "__main__":
    main()
