"""Damaged and hostile inputs of every kind, counted: what is not a refusal in one line, deaths, hangs, memory.

    python benchmarks/bench_fuzz.py --minutes 10 --seed 1            # every kind, an equal share of the time each
    python benchmarks/bench_fuzz.py --kinds mat feather --count 5000

Each kind runs in a process of its own, which writes down the number of the input in hand: after a death the next
process goes on behind it. Prints a line per kind and a total; ``--out`` writes all numbers.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "tests" / "files")]

HANG = {"options": 20.0}  # s of the processor; a command that reads no more than a file:
USUAL_HANG = 5.0


def work(kind: str, seed: int, first: int, count: int, seconds: float, folder: Path) -> dict[str, Any]:
    """Read inputs of one kind until their number or the time is reached."""
    from fuzz import RESULTS, targets

    from sindyjoint.errors import SindyJointError

    warnings.simplefilter("ignore")
    target = targets(folder, kind if kind in RESULTS else None)[kind]
    state = folder / "state.json"
    found: dict[str, Any] = {"refused": 0, "others": {}, "hangs": {}, "slowest": 0.0}
    end = time.process_time() + seconds
    number = first
    while number < first + count and time.process_time() < end:
        given = target.make(kind, seed, number)
        state.write_text(str(number))
        begun = time.process_time()
        try:
            target.run(given, folder)
        except SindyJointError as error:
            found["refused"] += 1
            if "\n" in str(error) or "\x1b" in str(error):
                found["others"].setdefault("a message of several lines", []).append(number)
        except Exception as error:  # what is counted here
            where = f"{type(error).__name__}: {' '.join(str(error).split())[:80]}"
            found["others"].setdefault(where, []).append(number)
        spent = time.process_time() - begun
        found["slowest"] = max(found["slowest"], spent)
        if spent > HANG.get(kind, USUAL_HANG):
            found["hangs"][number] = spent
        number += 1
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {**found, "read": number - first, "peak": peak}


def campaign(kind: str, seed: int, count: int, seconds: float) -> dict[str, Any]:
    """Read inputs of one kind in processes that may die."""
    total: dict[str, Any] = {
        "read": 0,
        "refused": 0,
        "others": {},
        "hangs": {},
        "deaths": {},
        "peak": 0.0,
        "slowest": 0.0,
    }
    begun, before, first = time.monotonic(), _processor_time(), 0
    spent = 0.0
    while first < count and spent < seconds and len(total["deaths"]) < 100:
        with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
            rest = max(seconds - spent, 1.0)
            command = [
                sys.executable,
                __file__,
                "--work",
                kind,
                str(seed),
                str(first),
                str(count - first),
                str(rest),
                folder,
            ]
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode == 0:
                part = json.loads(done.stdout.splitlines()[-1])
            elif not (state := Path(folder) / "state.json").exists():
                raise RuntimeError(done.stderr[-2000:])
            else:
                at = int(state.read_text())
                total["deaths"][at] = done.returncode
                part = {
                    "read": at + 1 - first,
                    "refused": 0,
                    "others": {},
                    "hangs": {},
                    "peak": 0.0,
                    "slowest": 0.0,
                }
        for key in ("read", "refused"):
            total[key] += part[key]
        for key in ("peak", "slowest"):
            total[key] = max(total[key], part[key])
        for key in ("others", "hangs"):
            total[key].update(part[key])
        first += part["read"]
        spent = _processor_time() - before
    return {**total, "seconds": spent, "clock": time.monotonic() - begun}


def together(record: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the sums, worst cases and finds of all kinds."""
    sums = {name: sum(each[name] for each in record) for name in ("read", "refused", "seconds")}
    worst = {name: max(each[name] for each in record) for name in ("peak", "slowest")}
    finds = {
        name: {f"{each['kind']} {at}": found for each in record for at, found in each[name].items()}
        for name in ("others", "hangs", "deaths")
    }
    return {"kind": "all these", "seed": record[0]["seed"], **sums, **worst, **finds}


def _processor_time() -> float:
    """Return what all processes that have ended took of the processor, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kinds", nargs="+", help="[all]")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=1_000_000, help="most inputs of a kind")
    parser.add_argument("--minutes", type=float, default=10.0, help="of the processor, of all kinds together")
    parser.add_argument("--out", help="file for all numbers")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        from fuzz import RESULTS, targets

        kinds = given.kinds or [*targets(Path(folder)), *RESULTS]
    record = []
    for kind in kinds:
        done = campaign(kind, given.seed, given.count, 60 * given.minutes / len(kinds))
        record.append({"kind": kind, "seed": given.seed, **done})
        print(
            f"{kind:<10}{done['read']:>8} inputs, {done['refused']:>8} refused, "
            f"{sum(map(len, done['others'].values())):>3} other exceptions, "
            f"{len(done['deaths']):>3} deaths, {len(done['hangs']):>2} over {HANG.get(kind, USUAL_HANG):g} s (slowest "
            f"{done['slowest']:.2f} s), peak {done['peak']:.0f} MB, {done['seconds']:.0f} s",
            flush=True,
        )
        for what, numbers in done["others"].items():
            print(f"    {what}: inputs {numbers[:5]}", flush=True)
        if done["deaths"]:
            print(f"    deaths: {dict(list(done['deaths'].items())[:5])}", flush=True)
    if len(record) > 1:
        record.append(together(record))
        print(
            "seed {seed}: {read} inputs in {seconds:.0f} s, {refused} refused; other exceptions {others}, "
            "deaths {deaths}, hangs {hangs}, highest peak {peak:.0f} MB".format_map(record[-1])
        )
    if given.out:
        Path(given.out).write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    if sys.argv[1:2] == ["--work"]:
        kind, seed, first, count, seconds, folder = sys.argv[2:]
        print(json.dumps(work(kind, int(seed), int(first), int(count), float(seconds), Path(folder))))
    else:
        main()
