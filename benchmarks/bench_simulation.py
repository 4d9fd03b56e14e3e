"""How fast the simulations are, side by side with SciPy and OpenSees, in the processor's time.

python benchmarks/bench_simulation.py --json simulation.json
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1] / "tests" / "mechanics"), str(Path(__file__).parents[1])]

from hybrid_reference import solve_stick_slip  # noqa: E402

from benchmarks.resumed import with_rows, write_rows  # noqa: E402
from sindyjoint.mechanics import INTER_PANEL, PaperLaw  # noqa: E402
from sindyjoint.mechanics.excitation import harmonic, pulse  # noqa: E402
from sindyjoint.mechanics.rigs import load_rig  # noqa: E402
from sindyjoint.mechanics.stickslip import simulate, simulate_many  # noqa: E402

AMPLITUDE, FREQUENCY, DURATION, RATE = 5.0, 4.0, 10.0, 1000.0
DRIVE = harmonic(AMPLITUDE, FREQUENCY)


def best(function, repeats=5, clock=time.process_time):
    """Shortest of several times, s; of the processor, so that other work on the machine does not count."""
    times = []
    for _ in range(repeats):
        start = clock()
        function()
        times.append(clock() - start)
    return min(times)


FIRST_USES = {
    "single joint": (
        "from sindyjoint.mechanics.excitation import harmonic\n"
        "from sindyjoint.mechanics import INTER_PANEL\n"
        "from sindyjoint.mechanics.stickslip import simulate\n"
        "simulate(INTER_PANEL, harmonic(5.0, 4.0), 10.0, 1000.0)\n"
    ),
    "pulse rig": "from sindyjoint.mechanics.rigs import load_rig\nload_rig('pulse-rig').respond()\n",
}


def first_use(code):
    """Processor seconds of a first simulation in a new process, imports included: compiled anew, from the cache."""
    code = f"import time\n{code}print(time.process_time())\n"
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "NUMBA_CACHE_DIR": cache, "OMP_NUM_THREADS": "1"}
        run = [sys.executable, "-c", code]
        return [float(subprocess.check_output(run, env=environment, text=True)) for _ in range(2)]


def row(what, seconds, error=None, ratio=None):
    """Return a line of the table: its time in ms, the error relative to the peak, how often ours fits into theirs."""
    return {"what": what, "ms": 1e3 * seconds, "error": error, "ratio": ratio}


def first_uses() -> Iterator[dict]:
    for name, code in FIRST_USES.items():
        anew, cached = first_use(code)
        yield row(f"{name}, first use, compiled", anew)
        yield row(f"{name}, first use, cached", cached)


def single_joint() -> Iterator[dict]:
    """10 s at 4 Hz on one core: ours, then SciPy's beside ours of the same error or less."""
    exact = simulate(INTER_PANEL, DRIVE, DURATION, RATE, rtol=1e-11).angle
    time_axis = np.arange(exact.size) / RATE

    def error(angle):
        return np.abs(angle - exact).max() / np.abs(exact).max()

    ours = []
    for rtol in (2e-3, 1e-4, 1e-6, 1e-8):
        motion = simulate(INTER_PANEL, DRIVE, DURATION, RATE, rtol=rtol)
        sets = np.tile(INTER_PANEL.parameters, (50, 1))
        options = {"parameters": sets, "rtol": rtol, "threads": 1}
        seconds = best(partial(simulate_many, INTER_PANEL, [DRIVE], DURATION, RATE, **options))
        ours.append((error(motion.angle), seconds / len(sets)))
        yield row(f"single joint, {rtol:.0e}", ours[-1][1], ours[-1][0])

    def moment(t):
        return AMPLITUDE * np.sin(2 * np.pi * FREQUENCY * t)

    for method, rtol in (("RK45", 1e-3), ("RK45", 1e-5), ("DOP853", 1e-8)):
        start = time.process_time()
        angle, _ = solve_stick_slip(INTER_PANEL, moment, DURATION, time_axis, rtol=rtol, method=method)
        seconds, deviation = time.process_time() - start, error(angle)
        equal = min((s for e, s in ours if e <= deviation), default=ours[-1][1])
        yield row(f"solve_ivp {method}, {rtol:.0e}", seconds, deviation, seconds / equal)


def structures() -> Iterator[dict]:
    for name in ("pulse-rig", "four-panel-wing"):
        rig = load_rig(name)
        rig.respond()
        yield row(name, best(rig.respond, 3))
    import pytest
    from test_structure import chain, opensees_pulse, respond

    structure = chain(PaperLaw(k1=6066.0))
    run = lambda: respond(structure, pulse(65.0, 0.005), duration=5.0)  # noqa: E731
    run()
    ours = best(run, 3)
    yield row("linear joint, beams", ours)
    try:
        theirs = best(lambda: opensees_pulse(None), 1)
    except pytest.skip.Exception as error:
        print(f"OpenSees: {error}")
    else:
        yield row("OpenSees, the same", theirs, ratio=theirs / ours)


if __name__ == "__main__":
    path = with_rows(argparse.ArgumentParser(description=__doc__)).parse_args().json
    rows = []
    for part in (first_uses, single_joint, structures):
        for each in part():
            print(" ".join(f"{key} {value}" for key, value in each.items() if value is not None), flush=True)
            rows.append(each)
    write_rows(path, rows)
