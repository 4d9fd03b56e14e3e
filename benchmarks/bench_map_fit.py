"""Coefficient errors beside the paper's own way: an n × n map of averaged moments and a surface fitted to it.

python benchmarks/bench_map_fit.py --seeds 8 --noise 0.01 --json map_fit.json

The paper's way here: both channels through a 60 Hz low-pass without phase (4th order, forwards and backwards), rate
and acceleration by central differences, all samples, n × n cells per frequency, surface fit, mean over frequencies.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np  # noqa: E402
from joblib import Parallel, delayed  # noqa: E402
from scipy.signal import butter, sosfiltfilt  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.resumed import with_rows, write_rows  # noqa: E402

NAMES = ("k1", "k2", "k3", "c1", "M_F")
CUT = 60.0


def paper_way(campaign, n: int) -> np.ndarray:
    """Return the five coefficients by map and surface fit, averaged over frequencies."""
    from sindyjoint.states.surface import fit_surface, force_state_map

    values = []
    for frequency in sorted({run.frequency for run in campaign.runs}):
        angle, rate, moment = [], [], []
        for run in (r for r in campaign.runs if r.frequency == frequency):
            low_pass = butter(4, CUT, fs=run.sample_rate, output="sos")
            theta, force = (sosfiltfilt(low_pass, signal) for signal in (run.angle, run.moment))
            omega = np.gradient(theta, 1 / run.sample_rate)
            alpha = np.gradient(omega, 1 / run.sample_rate)
            inside = slice(int(0.5 * run.sample_rate), -int(0.1 * run.sample_rate))
            angle.append(theta[inside])
            rate.append(omega[inside])
            moment.append((force - campaign.joint.inertia * alpha)[inside])
        surface = force_state_map(np.concatenate(angle), np.concatenate(rate), np.concatenate(moment), n)
        values.append(fit_surface(surface).coefficients)
    return np.mean(values, axis=0)


def one(drive: str, noise: float, seed: int, n: int) -> dict[str, np.ndarray]:
    from sindyjoint.mechanics import INTER_PANEL
    from sindyjoint.mechanics.virtual import virtual_campaign
    from sindyjoint.workflows.discover import discover

    truth = INTER_PANEL.parameters
    campaign = virtual_campaign(drive=drive, noise=noise, random_state=seed)
    found = discover(campaign, library="paper", threshold=0.0, correct=False)
    fixed = discover(campaign, library="paper", threshold=0.0)
    return {
        "map": paper_way(campaign, n) / truth - 1,
        "samples": found.model.coefficients / truth - 1,
        "corrected": fixed.model.coefficients / truth - 1,
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--noise", type=float, default=0.01)
    parser.add_argument("--cells", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=2)
    given = with_rows(parser).parse_args()
    print(f"RMS error, % of the true coefficient, {given.seeds} seeds at {given.noise:g} noise")
    rows = []
    for drive in ("moment", "rig", "displacement"):
        records = Parallel(n_jobs=given.jobs)(
            delayed(one)(drive, given.noise, seed, given.cells) for seed in range(given.seeds)
        )
        for way in records[0]:
            rms = 100 * np.sqrt(np.mean([np.square(record[way]) for record in records], axis=0))
            errors = dict(zip(NAMES, map(float, rms), strict=True))
            rows.append({"drive": drive, "way": way, "seeds": given.seeds, "noise": given.noise, **errors})
            print(f"{drive:<13}{way:<16}" + "".join(f"{name:>6}{x:>6.2f}" for name, x in errors.items()))
    write_rows(given.json, rows)


if __name__ == "__main__":
    main()
