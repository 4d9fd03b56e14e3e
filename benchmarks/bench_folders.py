"""From a folder of unknown files to a report: commands, seconds and questions, folder by folder.

python benchmarks/bench_folders.py run --out folders.jsonl
python benchmarks/bench_folders.py run --out folders.jsonl --public FOLDER
python benchmarks/bench_folders.py page folders.jsonl

``run`` writes one joint's runs into folders as laboratories leave them (tests/files/*_folders.py),
and copies those of ``--public`` without their manifests; then it types what a person would: ``init``, the same again
with answers where something is asked, and ``discover --out``. ``page`` writes
docs/folders.txt.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parent / "tests" / "files")]

from lab_folders import LAB, free_swings  # noqa: E402
from odd_folders import ODD, campaign  # noqa: E402
from own_folders import OWN, decays_below  # noqa: E402

from benchmarks.resumed import append, records_in  # noqa: E402

PAGE = HERE.parent / "docs" / "folders.txt"
# What a person who made the test would answer.
PUBLIC = {
    "emps": {
        "force": "vir", "displacement": "qm", "force.unit": "V", "force.gain": "35.15065188 N/V",
        "displacement.unit": "m",
    },
    "pendulum": {"moment": "0 N*m", "angle.unit": "rad"},
    "mr-damper-nees": {"rate": "3004.8 Hz"},
    "screw-tao": {"rate": "none"},
    "screw-tao-coarse": {"rate": "none"},
    "silverbox": {
        "force": "input_V", "displacement": "output_V", "force.gain": "1 N/V", "displacement.gain": "1 m/V",
    },
}  # fmt: skip
HEAD = """\
What it takes from a folder of files to a report, without an edited line: the commands as they were typed, the seconds
of processor time of each with the start of Python, and what init asked. The folders hold six runs of one simulated
joint (k1 = 6061 N*m/rad, five terms; free decays of another) as laboratories leave them; those at the end are public
data without their manifests. python benchmarks/bench_folders.py writes this file.
"""


def typed(arguments: Sequence[str], place: Path) -> tuple[float, subprocess.CompletedProcess[str]]:
    """Run a command as a new process, and return its seconds of processor time, whatever else the machine does."""
    environment = {**os.environ, "PYTHONPATH": str(HERE.parent)}
    command = [sys.executable, "-m", "sindyjoint", *arguments]
    before = os.times()
    done = subprocess.run(command, cwd=place, env=environment, capture_output=True, text=True)
    after = os.times()
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    return spent, done


def one(name: str, style: str, answers: dict[str, str], place: Path) -> dict:
    """Return how it went from the files in a folder to a report."""
    record: dict = {"name": name, "style": style, "commands": [], "asked": []}

    def do(*arguments: str) -> subprocess.CompletedProcess[str]:
        seconds, done = typed(arguments, place)
        record["commands"].append(
            [shlex.join(["sindyjoint", *arguments]), round(seconds, 1), done.returncode]
        )
        return done

    done = do("init", name)
    if done.returncode == 2:
        asked = re.search(r"(sindyjoint init .*)", done.stderr.replace("\n", " "))
        if asked is None:
            return record | {"said": done.stderr[-300:]}
        suggested = shlex.split(asked[1])
        record["asked"] = [word.partition("=")[0] for word in suggested if "=" in word]
        settings = [word for key, value in answers.items() for word in ("--set", f"{key}={value}")]
        done = do("init", name, *settings)
    verdict = re.search(r"the data are (\w+)", done.stdout)
    record["data"] = verdict[1] if verdict else done.stderr[-300:]
    if done.returncode:
        return record
    do("discover", name, "--out", f"{name}-report")
    model = place / f"{name}-report" / "model.json"
    terms = json.loads(model.read_text(encoding="utf-8"))["terms"] if model.is_file() else []
    return record | {"terms": [[term["id"], term["coefficient"], term["unit"]] for term in terms]}


def run(args: argparse.Namespace) -> None:
    truth = campaign()
    with TemporaryDirectory() as scratch:
        place = Path(scratch)
        for writer in (*LAB, *ODD, *OWN, free_swings, decays_below):
            if args.names and writer.__name__ not in args.names:
                continue
            (place / writer.__name__).mkdir()
            answers = writer(place / writer.__name__, truth)
            style = (writer.__doc__ or "").split("\n")[0]
            show(args.out, one(writer.__name__, style, answers, place))
        for folder in sorted(args.public.iterdir()) if args.public else ():
            if folder.is_dir() and (not args.names or folder.name in args.names):
                ignored = shutil.ignore_patterns("campaign.toml")
                shutil.copytree(folder, place / folder.name, ignore=ignored)
                show(args.out, one(folder.name, "Public data.", PUBLIC.get(folder.name, {}), place))


def show(out: Path, record: dict) -> None:
    append(out, record)
    print(json.dumps(record, ensure_ascii=False), flush=True)


def page(args: argparse.Namespace) -> None:
    """Write the log of what was run."""
    records = records_in([args.folders])
    lines = [HEAD]
    for record in records:
        lines += [f"{record['name']}: {record['style']}"]
        lines += [f"  $ {command}    # {seconds:g} s" for command, seconds, _ in record["commands"]]
        lines += [f"  asked: {', '.join(record['asked']) or 'nothing'}; the data are {record['data']}"]
        terms = ", ".join(f"{id} {value:.4g} {unit}" for id, value, unit in record.get("terms", []))
        lines += [f"  found: {terms or 'no model, with the reason in the report'}", ""]
    PAGE.write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(required=True)
    running = verbs.add_parser("run")
    running.add_argument("--out", type=Path, required=True)
    running.add_argument("--public", type=Path)
    running.add_argument("--names", nargs="*")
    running.set_defaults(do=run)
    writing = verbs.add_parser("page")
    writing.add_argument("folders", type=Path)
    writing.set_defaults(do=page)
    arguments = parser.parse_args()
    arguments.do(arguments)
