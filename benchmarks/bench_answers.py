"""Can I trust it: what four verbs say of one campaign and one model, folder by folder, beside the scatter of its repeats.

python benchmarks/bench_answers.py DATA [--out answers.json] [--only NAME ...]

DATA has a folder per campaign. The model is that of ``discover``; ``diagnose --model`` and ``verify`` are given it, and
``compare`` makes its own. Of each verb the answer, the gap, the floor and what is beyond it stand in one row; *agree* is
whether the verbs that judge one and the same model give the same answer about data, explained and determined.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

VERBS = ("discover", "diagnose", "verify", "compare")
COLOURS = ("data", "explained", "determined")


def asked(*words: str) -> dict[str, Any]:
    """Return what a command prints with ``--json``, or the reason why it does not."""
    command = [sys.executable, "-m", "sindyjoint", *words, "--json", "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode in (0, 1) and done.stdout:
        return json.loads(done.stdout)
    return {"failed": done.stderr.strip().splitlines()[-1:] or [f"exit status {done.returncode}"]}


def answers(folder: Path) -> dict[str, Any]:
    """Return the trust of each verb on one campaign."""
    with tempfile.TemporaryDirectory() as scratch:
        found = {"discover": asked("discover", str(folder), "--out", scratch)}
        if (Path(scratch) / "model.json").exists():
            found["diagnose"] = asked("diagnose", str(folder), "--model", scratch, "--no-advice", "--max-effects", "0")
            found["verify"] = asked("verify", scratch, str(folder))
        found["compare"] = asked("compare", str(folder))
    return {verb: each.get("trust", each) for verb, each in found.items()}


def row(verb: str, trust: dict[str, Any]) -> str:
    if "failed" in trust:
        return f"  {verb:9s} {trust['failed'][0][:110]}"
    explained = trust.get("explained", {})
    gap, floor = (explained.get(name) for name in ("gap", "floor"))
    figures = "  ".join("–" if value is None else f"{100 * value:.3g} %" for value in (gap, floor))
    colours = " ".join(f"{name} {trust[name]['colour']}" for name in (*COLOURS, "predicts") if name in trust)
    return f"  {verb:9s} {trust['answer']:8s} {figures:20s} {colours}"


def agree(found: dict[str, Any]) -> bool:
    """Return whether the verbs that were given the model of ``discover`` say of it what ``discover`` says."""
    own = found["discover"]
    others = [found[verb] for verb in ("diagnose", "verify") if verb in found]
    return all(
        each.get(name, {}).get("colour") == own[name]["colour"]
        for each in others
        for name in COLOURS
        if name in own
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--only", nargs="*")
    arguments = parser.parse_args()
    record = {}
    for folder in sorted(path.parent for path in arguments.data.glob("*/campaign.toml")):
        if arguments.only and folder.name not in arguments.only:
            continue
        record[folder.name] = found = answers(folder)
        print(f"{folder.name}: {'agree' if agree(found) else 'DO NOT AGREE'}", flush=True)
        for verb in VERBS:
            if verb in found:
                print(row(verb, found[verb]), flush=True)
        if arguments.out:
            arguments.out.write_text(json.dumps(record, indent=1))


if __name__ == "__main__":
    main()
