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
from contextlib import suppress
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


def kills(campaigns: int, folder: str, count: int, seed: int = 1, *ways: str) -> dict[str, Any]:
    """Kill a batch with all its processes at random instants, again and again, and hold what comes of it to the byte.

    Names of campaigns share their beginnings, some beyond what a folder's name may have. In every second life a run
    file has vanished; before the next one it is back.
    """
    import random

    source = alike_campaigns(folder, campaigns)
    whole = Path(folder) / "out-whole-alike"
    shutil.rmtree(whole, ignore_errors=True)
    record = {}
    for way in ways or ("--jobs 1", "--jobs 2", "--workers 2"):
        rng = random.Random(f"{seed}/{way}")
        _, clock = timed(lambda way=way: (shutil.rmtree(whole, ignore_errors=True), done(source, whole, way)))
        spent, ends, identical, vanished = clock["seconds"], 0, True, 0
        out = fresh(whole)
        for number in range(count):
            victim = rng.choice(sorted(source.rglob("low.csv"))) if number % 2 else None
            if victim is not None:
                victim.rename(victim.with_suffix(".away"))
            run = subprocess.Popen(
                command(source, out, way), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                start_new_session=True,
            )  # fmt: skip
            with suppress(subprocess.TimeoutExpired):
                run.wait(rng.uniform(0, spent))
            with suppress(ProcessLookupError):
                os.killpg(run.pid, signal.SIGKILL)
            run.wait()
            if victim is not None:
                victim.with_suffix(".away").rename(victim)
                vanished += 1
            if run.returncode != -signal.SIGKILL or number == count - 1:
                # It was done before the instant came, or this was the last kill: one more run ends it.
                done(source, out, way)
                ends += 1
                identical &= same(out, whole) and not list(out.rglob(".*"))
                out = fresh(whole)
        text = f"{count} kills, {vanished} lives without one run file, {ends} batches brought to their end"
        record[f"{way}, killed at random instants, seed {seed}"] = {"identical": identical, "text": text}
    return record


def alike_campaigns(folder: str, count: int) -> Path:
    """Return a folder of small campaigns whose names begin alike; what is there already is kept."""
    sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "scaling"))
    from small_joints import write_joint

    source = Path(folder) / f"alike-{count}"
    heads = ("j", "joint", "joint.1", "x" * 90, "joint-")
    for number in range(count):
        home = source / f"{heads[number % len(heads)]}{number // len(heads) or ''}"
        if not (home / "campaign.toml").exists():
            write_joint(home, number)
    return source


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


THREADS = """
import sys, threading
import sindyjoint
from sindyjoint.reporting.output import write_results
def work(name):
    found = sindyjoint.discover(f"{sys.argv[1]}/{name}", "paper", correct=False)
    write_results(found, f"{sys.argv[2]}/{name}")
threads = [threading.Thread(target=work, args=(name,)) for name in sys.argv[3:]]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
"""


def together(count: int, folder: str) -> dict[str, Any]:
    """Discover so many campaigns at once, by processes and by threads, into one parent: the model of each as by itself.

    Processes and threads begin with one and the same empty cache of compiled code.
    """
    source = alike_campaigns(folder, count)
    names = sorted(path.name for path in source.iterdir())
    single = [sys.executable, "-m", "sindyjoint", "discover", "-q", "-l", "paper", "--no-correct"]
    found: dict[str, list[bytes]] = {}
    for way in ("alone", "processes", "threads"):
        out = Path(folder) / f"out-{way}"
        shutil.rmtree(out, ignore_errors=True)
        environment = dict(os.environ)
        if way != "alone":
            environment["NUMBA_CACHE_DIR"] = str(Path(folder) / f"cache-{way}")
            shutil.rmtree(environment["NUMBA_CACHE_DIR"], ignore_errors=True)
        commands = [[*single, str(source / name), "--out", str(out / name)] for name in names]
        if way == "threads":
            commands = [[sys.executable, "-c", THREADS, str(source), str(out), *names]]
        runs = []
        for each in commands:
            runs.append(
                subprocess.Popen(
                    each, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
                )
            )
            if way == "alone":
                runs[-1].communicate()
        errors = [run.communicate()[1] if way != "alone" else "" for run in runs]
        if any(errors) or any(run.returncode for run in runs):
            raise RuntimeError(f"{way}: {errors}")
        leftovers = [path for path in out.rglob(".*")]
        found[way] = [(out / name / "model.json").read_bytes() for name in names] + [b""] * len(leftovers)
    return {
        way: {
            "identical": found[way] == found["alone"],
            "text": f"{count} campaigns into one parent, at once",
        }
        for way in ("processes", "threads")
    }


TASKS = {task.__name__: task for task in (batch, restart, kills, together)}

if __name__ == "__main__":
    name, *arguments = sys.argv[1:]
    print(json.dumps(TASKS[name](*[int(a) if a.isdigit() else a for a in arguments])))
