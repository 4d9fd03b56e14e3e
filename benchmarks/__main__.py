"""Speed and memory beside pysindy, scikit-learn, solve_ivp, OpenSees and the limit of the machine, in one command.

    python -m benchmarks                      # some minutes
    python -m benchmarks --rows 100000000     # 2.4 GB on disk, in --folder
    python -m benchmarks --campaigns 200      # the batch on one process, two processes, two Dask workers
    python -m benchmarks --only restart --campaigns 200     # the batch killed at half, and a worker of it killed
    python -m benchmarks --only kills --campaigns 60 --kills 20     # killed at random instants, restarted, compared
    python -m benchmarks --only together      # eight processes, then eight threads, on one cache and one parent folder
    python -m benchmarks --only doors         # coefficients by pysindy.SINDy, JointRegressor and discover: 50 joints
    python -m benchmarks verdicts --data ../shared/data     # public data: verdict, base, gaps, floors, seconds
    python -m benchmarks public --data ../shared/data       # public data in the metric of their owners
    python -m benchmarks round-trip --seeds 0               # a diagnosis saved, read and verified: the same gap

Prints a table of ratios and writes all numbers to --out. Every measurement has a process of its own; ratios compare
processes of one call. On a machine that others use too, believe processor times before those of the clock.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.resumed import with_rows, write_rows

HERE = Path(__file__).resolve().parent
# What is reckoned of a large batch: samples, bytes of one, workers, bytes per second from their disk. Read twice: each
# file is hashed.
SAMPLES, WIDTH, WORKERS, DISK = 1e12, 16, 50, 1.5e9
ROWS: list[dict[str, str]] = []  # what is printed, as rows of the guide's page


def run(task: str, *arguments: object, module: str = "tasks.py") -> Any:
    """Return what one measurement prints."""
    print(f"… {task} {' '.join(map(str, arguments))}", file=sys.stderr, flush=True)
    command = [sys.executable, str(HERE / module), task, *map(str, arguments)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def line(text: str, value: str, note: str = "") -> None:
    ROWS.append({"task": text.strip(), "value": value, "note": note})
    print(f"{text:<58}{value:>16}  {note}", flush=True)


def exponent(sizes: list[int], times: list[float]) -> float:
    """Return the slope of log time over log size."""
    return float(np.polyfit(np.log(sizes), np.log(times), 1)[0])


def fits(sizes: list[int], folder: str) -> list[dict[str, Any]]:
    record = []
    for n in sizes:
        path = run("table", n, folder)["path"]
        ours, theirs = run("fit_ours", n, path, "memory"), run("fit_pysindy", n, path)
        streamed = run("fit_ours", n, path, "disk")
        a, b = ours["coefficients"], theirs["coefficients"]
        apart = max(abs(a[name] / b[name] - 1) for name in a if name in b)
        record.append(
            {"rows": n, "ours": ours, "ours from disk": streamed, "pysindy": theirs, "difference": apart}
        )
        clock, processor = (theirs[key] / ours[key] for key in ("seconds", "cpu"))
        line(
            f"JointRegressor, pysindy's STLSQ: {n:.0e} rows x 24",
            f"{ours['seconds']:.3g} s, {theirs['seconds']:.3g} s",
            f"ratio {clock:.0f}, by processor {processor:.0f}; coefficients differ by {apart:.0e}",
        )
        line(
            "  peak memory: ours from disk, pysindy",
            f"{streamed['peak']:.0f}, {theirs['peak']:.0f} MB",
            f"ratio {theirs['peak'] / streamed['peak']:.1f}; ours from arrays {ours['peak']:.0f} MB",
        )
    return record


def from_disk(sizes: list[int], limit: dict[str, float], folder: str) -> dict[str, Any]:
    record: dict[str, Any] = {"runs": []}
    for n in sizes:
        run("table", n, folder)
        done = run("disk", n, folder)
        arithmetic = n * limit["dsyrk ns per row of 21 columns in cache"] / 1e9
        bound = max(done["reading"], arithmetic)
        record["runs"].append({**done, "limit": bound})
        line(f"from disk, {n:.0e} rows x 20", f"{done['seconds']:.3g} s",
             f"{done['seconds'] / bound:.2f} x the limit of {bound:.3g} s (reading {done['reading']:.3g}, dsyrk "
             f"{arithmetic:.3g}); peak {done['peak']:.0f} MB")  # fmt: skip
    if len(sizes) > 1:
        # Below a million rows the start of everything is no longer small beside them.
        large = [r for r in record["runs"] if r["rows"] >= 1_000_000]
        if len(large) > 1:
            record["exponent"] = exponent([r["rows"] for r in large], [r["cpu"] for r in large])
            line("  growth beyond 1e6 rows (processor time)", f"n^{record['exponent']:.3f}")
    return record


def statistics(n: int, small: int, folder: str) -> dict[str, Any]:
    run("table", n, folder)
    ours, theirs = run("statistics", n, folder), run("statistics_pysindy", small)
    names = ("leave one frequency out", "bootstrap of 500")
    extra = sum(ours[name]["cpu"] for name in names) / ours["single pass"]["cpu"]
    other = sum(theirs[name]["cpu"] for name in names) / theirs["single pass"]["cpu"]
    line(f"leave-one-out and 500 replicates on top of a pass, {n:.0e}", f"{extra:.1%}", "of the single pass")
    anew = ours["discovery anew in each fold"]["cpu"] / ours["single pass"]["cpu"]
    line(
        "  terms found anew in each fold, by evidence",
        f"{anew:.1%}",
        "of the single pass; pysindy has no such thing",
    )
    line(f"  the same by refits of pysindy, {small:.0e} rows", f"{other:.0%}", f"ratio {other / extra:.0f}")
    return {"ours": ours, "pysindy": theirs, "share": extra, "share by refits": other}


def others() -> dict[str, Any]:
    subset, motion, flows = run("best_subset", 10_000), run("simulation"), run("workflows")
    ratio = subset["scikit-learn"]["cpu"] / subset["ours"]["cpu"]
    line(
        "best sets of every size, 12 candidates",
        f"{subset['ours']['seconds'] * 1e3:.3g} ms",
        f"{subset['sets']} refits of scikit-learn: ratio {ratio:.0f}",
    )
    joint = motion["one joint, 10 s"]
    ratio = motion["solve_ivp"]["cpu"] / joint["cpu"]
    line(
        "simulation of a stick-slip joint, 10 s",
        f"{joint['seconds'] * 1e3:.3g} ms",
        f"solve_ivp: ratio {ratio:.0f}",
    )
    if isinstance(motion["OpenSees"], dict):
        line("simulation of a chain of panels, 5 s", f"{motion['chain, 5 s']['seconds'] * 1e3:.3g} ms",
             f"OpenSees: ratio {motion['OpenSees']['cpu'] / motion['chain, 5 s']['cpu']:.0f}")  # fmt: skip
    for name in ("discover, warm", "diagnose", "report"):
        line(name, f"{flows[name]['seconds']:.3g} s", f"{flows[name]['cpu']:.3g} s of the processor")
    further = flows["a further sample"]
    hours = further * SAMPLES / 3600
    line("discover, a further sample", f"{1e6 * further:.2g} µs", "of the processor")
    line(f"  10 000 joints x 100 runs x 1e6 samples: {SAMPLES:.0e}, reckoned, not run", f"{hours:.0f} core hours",
         f"on {WORKERS} workers {hours / WORKERS:.1f} h; read twice at {DISK / 1e9:g} GB/s "
         f"{2 * SAMPLES * WIDTH / DISK / 3600:.1f} h")  # fmt: skip
    print("where the time of a discovery goes, once everything is imported:")
    for text in flows["profile"]:
        print(f"  {text}")
    return {"best subset": subset, "simulation": motion, "workflows": flows}


def batches(campaigns: int, folder: str) -> dict[str, Any]:
    ways = ("--jobs 1", "--jobs 2", "--workers 1", "--workers 2")
    # There and back, and the better of both: what else the machine does in between favours none.
    rounds = [
        (way, run("batch", campaigns, folder, way, module="batch_tasks.py")) for way in (*ways, *ways[::-1])
    ]
    record = {
        way: min((spent for name, spent in rounds if name == way), key=lambda spent: spent["seconds"])
        for way in ways
    }
    for way in ways:
        one, this = record["--jobs 1"], record[way]
        line(
            f"batch of {campaigns} campaigns, {way}",
            f"{this['seconds']:.1f} s",
            f"{one['seconds'] / this['seconds']:.2f} x one process; {this['cpu']:.1f} s of the processors, "
            f"{this['cpu'] / one['cpu']:.2f} x; of it to start and to end {this['start']:.1f} s",
        )
    return {"best": record, "rounds": rounds}


def restarts(campaigns: int, folder: str) -> dict[str, Any]:
    record = run("restart", campaigns, folder, module="batch_tasks.py")
    for name, what in record.items():
        line(f"batch of {campaigns}, {name}", "identical" if what["identical"] else "DIFFERENT", what["text"])
    return record


def many_kills(campaigns: int, folder: str, count: int) -> dict[str, Any]:
    record = run("kills", campaigns, folder, count, module="batch_tasks.py")
    for name, what in record.items():
        line(f"batch of {campaigns}, {name}", "identical" if what["identical"] else "DIFFERENT", what["text"])
    return record


def at_once(campaigns: int, folder: str) -> dict[str, Any]:
    record = run("together", campaigns, folder, module="batch_tasks.py")
    for name, what in record.items():
        line(
            f"{campaigns} {name} on one cache",
            "identical" if what["identical"] else "DIFFERENT",
            what["text"],
        )
    return record


def doors() -> list[dict[str, Any]]:
    record = run("--json", "--joints", 50, module="bench_doors.py")
    known = [each for each in record if "difference" in each]
    refused = [each["name"] for each in record if "refused" in each]
    for kind, found in (
        ("random joints", [each for each in known if each["name"].startswith("joint ")]),
        ("public campaigns", [each for each in known if not each["name"].startswith("joint ")]),
    ):
        if found:
            worst = max(found, key=lambda each: each["difference"])
            line(f"largest difference, {len(found)} {kind}",
                 f"{worst['difference']:.1e}", f"{worst['name']}, {worst['terms']} terms")  # fmt: skip
        else:
            print(f"no {kind}: the data is not beside the checkout")
    if refused:
        line("  refused", f"{len(refused)}", ", ".join(refused))
    return record


def main() -> None:
    """Measure, print, write; or make one of the tables that have a name."""
    if sys.argv[1:2] == ["verdicts"]:
        from benchmarks import bench_public

        bench_public.main(sys.argv[2:])
        return
    if sys.argv[1:2] == ["published"]:
        from benchmarks import published

        published.main(sys.argv[2:])
        return
    if sys.argv[1:2] == ["round-trip"]:
        from benchmarks import bench_round_trip

        bench_round_trip.main(sys.argv[2:])
        return
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rows", type=int, default=10_000_000, help="most rows from disk [1e7]")
    parser.add_argument("--campaigns", type=int, default=0, help="campaigns of the batch; 0: no batch")
    parser.add_argument(
        "--only",
        nargs="+",
        choices=["fit", "disk", "statistics", "others", "batch", "restart", "kills", "together", "doors"],
    )
    parser.add_argument("--kills", type=int, default=20, help="of a batch, for each way to run it")
    parser.add_argument("--folder", help="where large files are made and kept; default: a temporary one")
    parser.add_argument("--out", default="benchmarks.json", help="file for all numbers")
    given = with_rows(parser).parse_args()
    many = ["batch", "restart"] if given.campaigns else []
    wanted = given.only or ["fit", "disk", "statistics", "others", *many]
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.folder or temporary
        Path(folder).mkdir(parents=True, exist_ok=True)
        limit = run("limits") if {*wanted} - {"kills", "together", "doors"} else {}
        record: dict[str, Any] = {"load at the beginning": os.getloadavg()[0], "limits": limit}
        for name, value in limit.items():
            line(name, f"{value:.3g}")
        if "fit" in wanted:
            record["fit"] = fits([10_000, 100_000, 2_000_000], folder)
        if "disk" in wanted:
            sizes = [n for n in (10_000, 100_000, 1_000_000, 10_000_000, 100_000_000) if n <= given.rows]
            record["disk"] = from_disk(sizes, limit, folder)
        if "statistics" in wanted:
            record["statistics"] = statistics(min(given.rows, 10_000_000), 20_000, folder)
        if "others" in wanted:
            record["others"] = others()
        if "batch" in wanted:
            record["batch"] = batches(given.campaigns or 12, folder)
        if "restart" in wanted:
            record["restart"] = restarts(given.campaigns or 12, folder)
        if "kills" in wanted:
            record["kills"] = many_kills(given.campaigns or 60, folder, given.kills)
        if "together" in wanted:
            record["together"] = at_once(given.campaigns or 8, folder)
        if "doors" in wanted:
            record["doors"] = doors()
        record["load at the end"] = os.getloadavg()[0]
    Path(given.out).write_text(json.dumps(record, indent=1) + "\n")
    write_rows(given.json, [row for row in ROWS if row["note"]])  # the others are what the machine can do
    print(f"all numbers: {given.out}")


if __name__ == "__main__":
    main()
