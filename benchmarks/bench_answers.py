"""Can I trust it: what four verbs say of one campaign and one model, folder by folder.

python benchmarks/bench_answers.py DATA [--out answers.json] [--only NAME ...]

DATA has a folder per campaign. ``verify`` is asked about the model of ``discover``, and about that of ``diagnose``;
``compare`` finds the model of ``discover`` again. Answer, gap, floor and colours of a verb stand in one row; verbs
*agree* where answers about one model are the same, and floors about one campaign within a tenth.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

PAIRS = (("discover", "verify"), ("discover", "compare"), ("diagnose", "verify of it"))
COLOURS = ("data", "explained", "determined", "predicts")


def asked(*words: str) -> dict[str, Any]:
    """Return what a command prints with ``--json``, or the reason why it does not."""
    command = [sys.executable, "-m", "sindyjoint", *words, "--json", "--quiet"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run(command, capture_output=True, text=True)
    spent = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    if done.returncode in (0, 1) and done.stdout:
        return json.loads(done.stdout) | {"seconds": spent}
    return {"failed": done.stderr.strip().splitlines()[-1:] or [f"exit status {done.returncode}"]}


def answers(folder: Path) -> dict[str, Any]:
    """Return what each verb answers on one campaign, and the processor's seconds."""
    found = {}
    for verb, after, options in (("discover", "verify", ()), ("diagnose", "verify of it", ("--no-advice",))):
        with tempfile.TemporaryDirectory() as scratch:
            found[verb] = asked(verb, str(folder), "--out", scratch, *options)
            if (Path(scratch) / "model.json").exists():
                found[after] = asked("verify", scratch, str(folder))
    found["compare"] = asked("compare", str(folder))
    return found


def trusts(found: dict[str, Any]) -> dict[str, Any]:
    """Return the trust of each verb, or why it gave no answer."""
    return {
        verb: each.get("trust") or {"failed": each.get("failed") or [each.get("verdict", "refused")]}
        for verb, each in found.items()
    }


def row(verb: str, trust: dict[str, Any]) -> str:
    if "failed" in trust:
        return f"  {verb:12s} {trust['failed'][0][:110]}"
    explained = trust.get("explained", {})
    gap, floor = (explained.get(name) for name in ("gap", "floor"))
    figures = "  ".join("–" if value is None else f"{100 * value:.3g} %" for value in (gap, floor))
    colours = " ".join(f"{name} {trust[name]['colour']}" for name in COLOURS if name in trust)
    return f"  {verb:12s} {trust['answer']:8s} {figures:20s} {colours}"


def agree(found: dict[str, Any]) -> bool:
    """Return whether verbs that answer about one model give one answer, and all of them one floor."""
    given = {verb: trust for verb, trust in found.items() if "failed" not in trust}
    same = all(
        given[one]["answer"] == given[other]["answer"]
        for one, other in PAIRS
        if one in given and other in given
    )
    floors = [trust.get("explained", {}).get("floor") for trust in given.values()]
    known = [floor for floor in floors if floor]
    return same and len(known) in (0, len(floors)) and (not known or max(known) <= 1.1 * min(known))


def kept(folder: str, found: dict[str, Any]) -> dict[str, Any]:
    """Return what a table says of a folder: answers, gaps and floor; verdict, names and gaps of the diagnosis."""
    record: dict[str, Any] = {"folder": folder, "agree": "yes" if agree(trusts(found)) else "no"}
    for verb in ("discover", "diagnose"):
        trust = found[verb].get("trust") or {}
        explained = trust.get("explained", {})
        record[verb] = trust.get("answer", "refused")
        record[f"{verb}_gap"], record["floor"] = explained.get("gap"), explained.get("floor")
    diagnosis = found["diagnose"]
    names = [step["class"] for step in diagnosis.get("steps", ())]
    record["names"] = ", ".join(
        members[0].replace("_", " ") + (f" or one of {len(members) - 1} more" if len(members) > 1 else "")
        for members in names
    )
    verdict = diagnosis.get("verdict", "refused").replace("_", " ")
    record["says"] = ": ".join(filter(None, (verdict, record["names"])))
    record["seconds"] = diagnosis.get("seconds")
    for end in ("initial", "final", "noise_floor"):
        for what in ("moment", "response"):
            record[f"{what}_{end}"] = diagnosis.get("gap", {}).get(end, {}).get(what)
    return record


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--only", nargs="*")
    arguments = parser.parse_args()
    record = []
    for folder in sorted(path.parent for path in arguments.data.glob("*/campaign.toml")):
        if arguments.only and folder.name not in arguments.only:
            continue
        found = answers(folder)
        record.append(kept(folder.name, found))
        print(f"{folder.name}: {'agree' if agree(trusts(found)) else 'DO NOT AGREE'}", flush=True)
        for verb, trust in trusts(found).items():
            print(row(verb, trust), flush=True)
        if arguments.out:
            arguments.out.write_text(json.dumps(record, indent=1))


if __name__ == "__main__":
    main()
