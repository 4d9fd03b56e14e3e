"""How fast the simulations are, side by side with scipy and OpenSees. Run: python benchmarks/bench_simulation.py."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "mechanics"))

from hybrid_reference import solve_stick_slip  # noqa: E402

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


def single_joint():
    exact = simulate(INTER_PANEL, DRIVE, DURATION, RATE, rtol=1e-11).angle
    time_axis = np.arange(exact.size) / RATE

    def error(angle):
        return np.abs(angle - exact).max() / np.abs(exact).max()

    print(
        f"single joint, {DURATION:g} s at {FREQUENCY:g} Hz, error of the angle relative to its peak, time of one core"
    )
    ours = []
    for rtol in (2e-3, 1e-4, 1e-6, 1e-8):
        motion = simulate(INTER_PANEL, DRIVE, DURATION, RATE, rtol=rtol)
        sets = np.tile(INTER_PANEL.parameters, (50, 1))
        options = {"parameters": sets, "rtol": rtol, "threads": 1}
        seconds = best(partial(simulate_many, INTER_PANEL, [DRIVE], DURATION, RATE, **options))
        seconds /= len(sets)
        ours.append((error(motion.angle), seconds))
        print(
            f"  sindyjoint rtol {rtol:7.0e}: error {ours[-1][0]:.1e}, {seconds * 1e3:7.3f} ms, {1 / seconds:.0f} runs/s"
        )

    def moment(t):
        return AMPLITUDE * np.sin(2 * np.pi * FREQUENCY * t)

    for method, rtol in (("RK45", 1e-3), ("RK45", 1e-5), ("DOP853", 1e-8)):
        start = time.process_time()
        angle, _ = solve_stick_slip(INTER_PANEL, moment, DURATION, time_axis, rtol=rtol, method=method)
        seconds, deviation = time.process_time() - start, error(angle)
        equal = min((s for e, s in ours if e <= deviation), default=ours[-1][1])
        print(f"  solve_ivp {method} rtol {rtol:.0e}: error {deviation:.1e}, {seconds * 1e3:7.0f} ms, "
              f"ratio {seconds / equal:.0f}")  # fmt: skip
    many = partial(simulate_many, INTER_PANEL, [DRIVE], DURATION, RATE, parameters=sets, rtol=2e-3)
    both = best(many, clock=time.perf_counter) / len(sets)
    print(f"  on {os.cpu_count()} threads at rtol 2e-3: {1 / both:.0f} runs/s")


def structures():
    print("structures, 20 s, warm")
    for name in ("pulse-rig", "four-panel-wing"):
        rig = load_rig(name)
        response = rig.respond()
        seconds = best(rig.respond, 3)
        print(f"  {name}: {seconds:.3f} s, {response.events} events, step {response.step * 1e3:g} ms")
    import pytest
    from test_structure import chain, opensees_pulse, respond

    try:
        theirs = best(lambda: opensees_pulse(None), 1)
    except pytest.skip.Exception as error:
        print(f"  OpenSees: {error}")
        return
    structure = chain(PaperLaw(k1=6066.0))
    run = lambda: respond(structure, pulse(65.0, 0.005), duration=5.0)  # noqa: E731
    run()
    ours = best(run, 3)
    print(
        f"  linear joint, 5 s at 0.5 ms: sindyjoint {ours:.3f} s, OpenSees {theirs:.3f} s, ratio {theirs / ours:.0f}"
    )


if __name__ == "__main__":
    for name, code in FIRST_USES.items():
        cold, cached = first_use(code)
        print(
            f"first use in a new process, {name}: {cold:.1f} s compiled anew, {cached:.1f} s from the cache"
        )
    single_joint()
    structures()
