"""How long a person waits at each door: whole processes, their processor time, medians of five, ratios in one run.

    python -m benchmarks.bench_speed                     # imports, verbs, the estimator
    python -m benchmarks.bench_speed --only verbs
    python -m benchmarks.bench_speed --profile discover  # what the time of one verb goes to
    python -m benchmarks.bench_speed --only growth       # how the time grows
    python -m benchmarks.bench_speed --only imports verbs estimator growth --json benchmarks/results/speed.json

The campaign is the virtual test of the paper's joint: twelve runs of 10 s as CSV files. Verbs are counted beyond a
process that imports numpy and scipy.linalg. Processor time is user and system time of the process and its children.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np

from benchmarks.resumed import with_rows, write_rows

ROWS: list[dict[str, str]] = []  # what is printed, as rows of the guide's page
COUNT = 5
BASE = ("-c", "import numpy, scipy.linalg")
PEER = ("-c", "import pysindy, sklearn")
#: Arguments of each verb and the seconds that it may take beyond the base; a page may take one more.
VERBS = {
    "check": ("check CAMPAIGN", 1.0),
    "discover": ("discover CAMPAIGN", 1.5),
    "verify": ("verify MODEL CAMPAIGN", 2.0),
    "diagnose": ("diagnose CAMPAIGN", 3.0),
    "plan": ("plan --campaign CAMPAIGN", 6.0),
    "compare": ("compare CAMPAIGN", 6.0),
}
#: The first fit of a process and later ones, by its processor clock; what stands before is not counted.
FIT = """
import sys, time
import numpy as np
from sindyjoint import JointRegressor, TermLibrary
import pysindy
rng = np.random.default_rng(0)
X = rng.uniform(-1, 1, (ROWS, 2)) * [8e-4, 0.02]
y = 6066 * X[:, 0] - 2.684e9 * X[:, 0] ** 3 + 1.867 * np.sign(X[:, 1]) + 0.01 * rng.normal(size=ROWS)
status = lambda key: next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith(key)) / 1024
before = status("VmRSS")
for _ in range(4):
    start = time.process_time()
    WORK
    print(time.process_time() - start)
print((status("VmHWM") - before) / ((X.nbytes + y.nbytes) / 2**20))
"""
OURS = 'JointRegressor("extended").fit(X, y)'
THEIRS = (
    'pysindy.SINDy(pysindy.STLSQ(threshold=0.02, alpha=0.0), feature_library=TermLibrary("extended"))'
    ".fit(X, 1e-3, x_dot=y[:, None])"
)

#: Work of a size, by what grows; the campaign is made before, and a small one of its kind is worked on first.
GROWTH = """
import sys, tempfile, time
import numpy as np
import sindyjoint
from sindyjoint.diagnosis.effects import load_effects
from sindyjoint.mechanics import virtual_campaign
kind, size = sys.argv[1], int(sys.argv[2])
plan = dict(levels=[0.35, 0.5, 0.63, 0.92], frequencies=[3.0], duration=3.0, rng=0)
small, library = virtual_campaign(**plan), "extended"
if kind == "runs":
    plan["frequencies"] = np.linspace(3, 6, size // 4)
elif kind == "samples a run":
    plan["duration"] = size / 1000
elif kind == "candidate terms":
    powers = [(i, n - i) for n in range(1, 12) for i in range(n, -1, -1)][:size]
    library = tempfile.mkdtemp() + "/powers.toml"
    with open(library, "w") as file:
        file.write('name = "powers"\\ndescription = "products of powers"\\n')
        for i, j in powers:
            file.write(
                f'[[term]]\\nid = "p{i}_{j}"\\nsymbol = "a{i}_{j}"\\nformula = "theta**{i}*omega**{j}"\\n'
                f'unit = "N*m*s**{j}/rad**{i + j}"\\nmeaning = "a power"\\nfamily = "powers"\\nname = "power"\\n'
            )
campaign = virtual_campaign(**plan)
def work(data):
    if kind == "effects":
        return sindyjoint.diagnose(data, effects=load_effects()[:size], advise=False)
    return sindyjoint.discover(data, library)
work(small)
start = time.process_time()
work(campaign)
print(time.process_time() - start)
"""
SIZES = {
    "runs": (4, 12, 40, 120, 400),
    "samples a run": (10_000, 100_000, 1_000_000),
    "candidate terms": (5, 10, 20, 40, 60),
    "effects": (7, 14, 28),
}


class Spent(NamedTuple):
    """Medians of some processes: processor time, s, and peak memory, MB."""

    seconds: float
    peak: float


def spent(arguments: Sequence[str], count: int = COUNT) -> Spent:
    """Return what a whole Python process takes with some arguments."""
    seconds, peaks = [], []
    command, quiet = [sys.executable, *arguments], subprocess.DEVNULL
    # As where it is installed: compiled Python is kept.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    subprocess.run(command, env=environment, stdout=quiet, stderr=quiet)
    for _ in range(count):
        process = subprocess.Popen(command, env=environment, stdout=quiet, stderr=quiet)
        _, status, used = os.wait4(process.pid, 0)
        assert status == 0, f"{' '.join(arguments)}: exit status {os.waitstatus_to_exitcode(status)}"
        seconds.append(used.ru_utime + used.ru_stime)
        peaks.append(used.ru_maxrss / 1024)
    return Spent(median(seconds), median(peaks))


def line(name: str, value: float, limit: str, of: str) -> None:
    ROWS.append({"task": name.strip(), "value": f"{value:.2f}", "of": of, "limit": limit})
    print(f"{name:<44}{value:>9.2f}  {of:<32} {limit}", flush=True)


def imports() -> None:
    """Print what the package and its help take beside Python and numpy."""
    bare, numpy = spent(("-c", "pass")), spent(("-c", "import numpy"))
    package, shown = spent(("-c", "import sindyjoint")), spent(("-m", "sindyjoint", "--help"))
    typer, peer = spent(("-c", "import typer")), spent(PEER)
    line("import sindyjoint", package.seconds / numpy.seconds, "≤ 1.3", "of import numpy")
    line("sindyjoint --help", shown.seconds / bare.seconds, "≤ 4", "of python -c pass")
    line("sindyjoint --help", shown.seconds / typer.seconds, "", "of import typer")
    line("import pysindy, sklearn", peer.seconds, "", "s")


def verbs(folder: Path, names: Sequence[str]) -> None:
    """Print what each verb takes beyond the base, and its page beyond the verb."""
    files = make_campaign(folder)
    base = spent(BASE).seconds
    line("import numpy, scipy.linalg", base, "", "s")
    for name in names:
        words, limit = VERBS[name]
        command = ["-m", "sindyjoint", *(files.get(word, word) for word in words.split()), "--quiet"]
        plain, paged = spent(command), spent([*command, "--out", str(folder / f"out-{name}"), "--force"])
        line(name, plain.seconds - base, f"≤ {limit:g}", f"s beyond it; {plain.peak:.0f} MB")
        line(f"  {name}: page", paged.seconds - plain.seconds, "≤ 1", "s more")
        more = {"page": f"{paged.seconds - plain.seconds:.2f}", "aim": f"{limit:g}", "kind": "verb"}
        ROWS.append({"task": name, "value": f"{plain.seconds - base:.2f}", **more})


def make_campaign(folder: Path) -> dict[str, str]:
    """Write the campaign, and the model that discover finds; return them by the words of a command."""
    from sindyjoint.files import write_campaign
    from sindyjoint.mechanics import virtual_campaign

    write_campaign(virtual_campaign(random_state=0), folder / "campaign")
    command = [sys.executable, "-m", "sindyjoint", "discover", folder / "campaign", "--out", folder / "found"]
    subprocess.run(command, check=True, capture_output=True)
    return {"CAMPAIGN": str(folder / "campaign"), "MODEL": str(folder / "found" / "model.json")}


def estimator(rows: int) -> None:
    """Print first and later fits of the estimator beside pysindy's with the same library, and the memory of both."""
    found = {}
    for name, work in (("ours", OURS), ("pysindy", THEIRS)):
        program = FIT.replace("ROWS", str(rows)).replace("WORK", work)
        done = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
        *times, memory = map(float, done.stdout.split())
        found[name] = times[0], median(times[1:]), memory
    for place, (what, limit) in enumerate((("first fit", "≥ 15"), ("later fits", "≥ 40"))):
        ours, theirs = found["ours"][place], found["pysindy"][place]
        line(
            f"{what}, {rows:.0e} rows x 24",
            theirs / ours,
            limit,
            f"pysindy {theirs:.2f} s, ours {ours:.2f} s",
        )
    line(
        "memory beyond the rows, of the rows", found["ours"][2], "≤ 0.2", f"pysindy {found['pysindy'][2]:.1f}"
    )


def growth(kinds: Sequence[str]) -> None:
    """Print by which power of a size the time of its work grows, over all sizes and the last two."""
    for kind in kinds:
        seconds = []
        for size in SIZES[kind]:
            command = [sys.executable, "-c", GROWTH, kind, str(size)]
            done = subprocess.run(command, check=True, capture_output=True, text=True)
            seconds.append(float(done.stdout.split()[-1]))
            print(f"{size} {kind}: {seconds[-1]:.2f} s", flush=True)
        slopes = np.diff(np.log(seconds)) / np.diff(np.log(SIZES[kind]))
        power = float(np.polyfit(np.log(SIZES[kind]), np.log(seconds), 1)[0])
        sizes = f"{SIZES[kind][0]} to {SIZES[kind][-1]} {kind}: power of the time"
        line(sizes, power, "≤ 1.1", f"between the last two {slopes[-1]:.2f}")


def profile(name: str, folder: Path) -> None:
    """Print where the time of a verb goes."""
    files = make_campaign(folder)
    words = [files.get(word, word) for word in VERBS[name][0].split()]
    program = (
        "import cProfile, pstats, sys\nfrom sindyjoint.cli import main\nprofile = cProfile.Profile()\n"
        "try:\n    profile.runcall(main, sys.argv[1:])\nexcept SystemExit:\n    pass\n"
        "pstats.Stats(profile).sort_stats('cumulative').print_stats('sindyjoint/|__init__', 60)"
    )
    subprocess.run([sys.executable, "-c", program, *words, "--quiet"], check=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=["imports", "verbs", "estimator", "growth"])
    parser.add_argument("--verbs", nargs="+", choices=[*VERBS], default=[*VERBS])
    parser.add_argument("--rows", type=int, default=2_000_000, help="of the estimator's fit [2e6]")
    parser.add_argument("--profile", choices=[*VERBS], help="print where the time of one verb goes")
    parser.add_argument("--growth", nargs="+", choices=[*SIZES], default=[*SIZES])
    given = with_rows(parser).parse_args(arguments)
    wanted = given.only or ["imports", "verbs", "estimator"]
    with tempfile.TemporaryDirectory() as folder:
        if given.profile:
            profile(given.profile, Path(folder))
            return
        if "imports" in wanted:
            imports()
        if "verbs" in wanted:
            verbs(Path(folder), given.verbs)
        if "estimator" in wanted:
            estimator(given.rows)
        if "growth" in wanted:
            growth(given.growth)
    write_rows(given.json, ROWS)


if __name__ == "__main__":
    main()
