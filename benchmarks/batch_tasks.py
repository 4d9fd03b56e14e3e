"""The measurements of ``python -m benchmarks`` on batches: what they cost, and what a kill takes from them."""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

# First of all, for it sets how many threads linear algebra has.
from tasks import timed

STEP = 0.02


def campaigns_in(folder: str, count: int) -> Path:
    """Return a folder of campaigns, 12 runs of 10 s each; what is there already is kept."""
    from sindyjoint.files import write_campaign
    from sindyjoint.mechanics.virtual import virtual_campaign

    source = Path(folder) / f"campaigns-{count}"
    for number in range(count):
        if not (source / f"joint-{number:03d}" / "campaign.toml").exists():
            write_campaign(
                virtual_campaign(random_state=number, duration=10.0), source / f"joint-{number:03d}"
            )
    return source


def command(source: Path, out: Path, way: str) -> list[str]:
    """Return the batch as one types it."""
    return [sys.executable, "-m", "sindyjoint", "batch", str(source), "--out", str(out), "-q", *way.split()]


def done(source: Path, out: Path, way: str) -> str:
    """Run a batch and return what it prints."""
    return subprocess.run(command(source, out, way), check=True, stdout=subprocess.PIPE, text=True).stdout


def batch(campaigns: int, folder: str, way: str) -> dict[str, Any]:
    """Time of a batch, by the clock and by the processor of all its processes, and of a batch of a single campaign."""

    def spent(source: Path) -> dict[str, float]:
        shutil.rmtree(out, ignore_errors=True)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        _, clock = timed(lambda: done(source, out, way))
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return {"seconds": clock["seconds"], "cpu": used}

    out = Path(folder) / f"out-{way.replace(' ', '')}"
    source = campaigns_in(folder, campaigns)
    all_of_them, single = spent(source), spent(campaigns_in(folder, 1))
    start = single["seconds"] - (all_of_them["cpu"] - single["cpu"]) / max(campaigns - 1, 1)
    return {**all_of_them, "start": start, "single": single, "campaigns": campaigns}


def restart(campaigns: int, folder: str) -> dict[str, Any]:
    """Kill a batch at half and start it again; kill a worker of one; hold the results against undisturbed ones."""
    source, whole = campaigns_in(folder, campaigns), Path(folder) / "out-whole"
    shutil.rmtree(whole, ignore_errors=True)
    done(source, whole, "--jobs 2")
    record = {}
    for way in ("--jobs 2", "--workers 2"):
        record[f"{way}, killed at half and restarted"] = killed(source, whole, way, campaigns)
        record[f"{way}, one worker killed"] = without_worker(source, whole, way, campaigns)
    return record


def killed(source: Path, whole: Path, way: str, campaigns: int) -> dict[str, Any]:
    """Kill a batch with all its processes at half, and run the command again."""
    out = fresh(whole)
    run = subprocess.Popen(command(source, out, way), stdout=subprocess.DEVNULL, start_new_session=True)
    wait_for(run, lambda: len(times(out)) >= campaigns // 2)
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    before = times(out)
    again = done(source, out, way)
    kept = sum(times(out)[name] == when for name, when in before.items())
    told = f"{len(before)} of them done before" in again
    return {
        "identical": same(out, whole) and told and kept == len(before),
        "text": f"{len(before)} done when it was killed, {kept} of these not touched again, "
        f"{campaigns - kept} done after",
        "done before": len(before),
        "not touched again": kept,
    }


def without_worker(source: Path, whole: Path, way: str, campaigns: int) -> dict[str, Any]:
    """Kill one of the processes that work on campaigns, after a quarter of them."""
    out = fresh(whole)
    run = subprocess.Popen(command(source, out, way), stdout=subprocess.DEVNULL)
    wait_for(run, lambda: len(times(out)) >= campaigns // 4)
    victim = worker_of(run.pid)
    os.kill(victim, signal.SIGKILL)
    run.wait()
    return {
        "identical": run.returncode == 0 and same(out, whole),
        "text": f"process {victim} killed, exit status {run.returncode}, {len(times(out))} campaigns done",
    }


def worker_of(parent: int) -> int:
    """Return the process that has worked most of all that a batch has started."""
    import psutil

    below = psutil.Process(parent).children(recursive=True)
    return int(max(below, key=lambda process: process.cpu_times().user).pid)


def fresh(whole: Path) -> Path:
    """Return an empty folder beside another, of a name as long, for pages name their folder."""
    out = whole.with_name("out-other")
    shutil.rmtree(out, ignore_errors=True)
    return out


def times(out: Path) -> dict[str, int]:
    """Return when the record of each campaign that is done was written."""
    return {path.parent.name: path.stat().st_mtime_ns for path in out.glob("campaigns/[!.]*/record.json")}


def same(out: Path, whole: Path) -> bool:
    """Return whether two batches hold the same bytes: every file of every campaign, and both tables."""
    return content(out) == content(whole)


def content(out: Path) -> dict[str, bytes]:
    files = [*(out / "campaigns").rglob("*"), out / "batch.csv", out / "batch.json"]
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in files if path.is_file()}


def wait_for(run: subprocess.Popen[bytes], reached: Callable[[], bool]) -> None:
    """Wait until a batch has got so far; an error where it ends before."""
    while not reached():
        if run.poll() is not None:
            raise RuntimeError(f"the batch ended with status {run.returncode} before it could be disturbed")
        time.sleep(STEP)


TASKS = {task.__name__: task for task in (batch, restart)}

if __name__ == "__main__":
    name, *arguments = sys.argv[1:]
    print(json.dumps(TASKS[name](*[int(a) if a.isdigit() else a for a in arguments])))
