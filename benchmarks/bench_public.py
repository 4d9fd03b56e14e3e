"""What every set of public data is answered with: check, diagnosis, base, gaps, floors and time, in one table.

python -m benchmarks verdicts --data ../shared/data
python -m benchmarks verdicts --data ../shared/data --only emps pendulum --advice --out verdicts.jsonl

A verdict is read against its own figures: gap before and after are of data left out of the fit, the floor is measured.
The simulated response is that of runs for validation where there are any. Seconds are of the processor. Each set has a
process of its own, whose stages go to the terminal; what ``--out`` holds already is not made again, and its lines say
how each step changed the gaps, and what was warned of.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.resumed import append, records_in  # noqa: E402

COLUMNS = (
    "set", "data", "verdict", "names", "base", "moment gap", "floor", "response gap", "floor", "seconds",
)  # fmt: skip


def answer(folder: Path, advice: bool) -> dict:
    """Return what one set is answered with, its ``row`` in the table first; an error where nothing could be made."""
    from sindyjoint.errors import SindyJointError
    from sindyjoint.text import percent, spelled
    from sindyjoint.workflows.diagnose import diagnose

    start, said = time.process_time(), []
    with warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always")
        try:
            result = diagnose(
                folder, advise=advice, progress=lambda stage: print(f"  {stage}", file=sys.stderr)
            )
        except SindyJointError as error:
            spent = f"{time.process_time() - start:.0f}"
            refused = [folder.name, "", "refused", str(error)[:80], *[""] * (len(COLUMNS) - 5), spent]
            return {"set": folder.name, "advice": advice, "row": refused}
        said = [
            f"{each.category.__name__}: {each.message} ({each.filename}:{each.lineno})" for each in raised
        ]
    spent = f"{time.process_time() - start:.0f}"
    names = ", then ".join(f"{spelled(s.effect)} {s.probability:.2f}" for s in result.steps) or "none"
    first, last, floor = result.initial, result.final, result.noise_floor
    cells = [
        folder.name,
        result.soundness.verdict if result.soundness else "",
        result.verdict.replace("_", " "),
        names,
        base_of(result.warnings),
        f"{percent(first.moment)} to {percent(last.moment)}",
        percent(floor.moment),
        f"{percent(first.response)} to {percent(last.response)}",
        percent(floor.response),
        spent,
    ]
    steps = [
        {"effect": s.effect, "members": s.members, "parameters": s.parameters, "dropped": s.terms_dropped,
         "before": [s.gap_before.moment, s.gap_before.response],
         "after": [s.gap_after.moment, s.gap_after.response]}
        for s in result.steps
    ]  # fmt: skip
    unsure = result.uncertainty
    return {
        "set": folder.name, "advice": advice, "row": cells, "reason": result.reason, "steps": steps,
        "terms": {t.id: [t.coefficient, t.standard_error] for t in result.whole.terms} if result.whole else {},
        "uncertainty": [unsure.moment, unsure.response], "warnings": result.warnings, "raised": said,
    }  # fmt: skip


def answer_alone(folder: Path, arguments: argparse.Namespace) -> dict:
    """Return the answer made by a process of its own; what ends that process ends one line of the table."""
    command = [
        sys.executable,
        str(Path(__file__).resolve()),
        "--data",
        str(arguments.data),
        "--alone",
        folder.name,
    ]
    command += ["--advice"] if arguments.advice else []
    print(f"{folder.name} …", file=sys.stderr, flush=True)
    try:
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, timeout=arguments.seconds)
        return json.loads(done.stdout.splitlines()[-1])
    except (subprocess.TimeoutExpired, ValueError, IndexError) as error:
        why = "out of time" if isinstance(error, subprocess.TimeoutExpired) else "its process failed"
        failed = [folder.name, "", why, *[""] * (len(COLUMNS) - 3)]
        return {"set": folder.name, "advice": arguments.advice, "row": failed, "failed": True}


def base_of(warnings: Sequence[str]) -> str:
    """Return from where a search began, as its warning says."""
    begun = "the search started from "
    told = [line[len(begun) :].split(", which")[0] for line in warnings if line.startswith(begun)]
    return next((each for each in told if "given" not in each), "the paper's five terms")


def main(given: Sequence[str] | None = None) -> None:
    """Print the table, a line as soon as its set is done."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="folder that holds the sets")
    parser.add_argument("--only", nargs="*", help="names of sets")
    parser.add_argument("--advice", action="store_true", help="seek runs that would tell rivals apart, too")
    parser.add_argument("--out", help="file of one line for each set, appended to and resumed")
    parser.add_argument("--seconds", type=float, default=1800.0, help="of the clock, for one set [1800]")
    parser.add_argument("--alone", help=argparse.SUPPRESS)
    arguments = parser.parse_args(given)
    folders = sorted(path.parent for path in arguments.data.glob("*/campaign.toml"))
    if not folders:
        parser.error(f"{arguments.data} holds no folder with a campaign.toml")
    if arguments.alone:
        print(json.dumps(answer(arguments.data / arguments.alone, arguments.advice)))
        return
    known = records_in([arguments.out] if arguments.out else [])
    made = {each["set"]: each for each in known if each["advice"] == arguments.advice}
    print("| " + " | ".join(COLUMNS) + " |\n|" + "---|" * len(COLUMNS))
    for folder in folders:
        if arguments.only and folder.name not in arguments.only:
            continue
        found = made.get(folder.name) or answer_alone(folder, arguments)
        if arguments.out and folder.name not in made and not found.get("failed"):
            append(arguments.out, found)
        print("| " + " | ".join(found["row"]) + " |", flush=True)


if __name__ == "__main__":
    main()
