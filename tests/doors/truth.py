"""Campaigns whose law is known, written as a user would have them: nothing of the package makes their motion.

The angle is prescribed, so that the moment of a law without states is a formula; states are integrated by SciPy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

INERTIA = 0.02
LAW = {"linear_stiffness": 6000.0, "linear_damping": 45.0, "coulomb_friction": 1.9}
FREQUENCIES, LEVELS, RATE = (3.0, 4.0, 5.5), (2.5e-4, 4.5e-4, 7e-4), 500.0
NOISE = 0.003

MANIFEST = """[joint]
name = "{name}"
motion = "{motion}"
inertia = "{inertia} {mass}"

[channels]
rate = "{rate} Hz"
moment = {{ column = "moment", unit = "{moment}" }}
angle = {{ column = "angle", unit = "{angle}" }}
"""
UNITS = {
    "rotation": {"moment": "N*m", "angle": "rad", "mass": "kg*m^2"},
    "translation": {"moment": "N", "angle": "m", "mass": "kg"},
}


@dataclass
class Run:
    """One run as two columns."""

    name: str
    frequency: float
    level: float
    moment: np.ndarray
    angle: np.ndarray
    extra: str = ""


@dataclass
class Truth:
    """A law, and what would be measured of it."""

    law: dict = field(default_factory=lambda: dict(LAW))
    #: Further moment f(angle, rate, time) or of states: (n, slope(t, angle, rate, z), moment(angle, rate, z)).
    hidden: Callable | None = None
    states: tuple | None = None
    inertia: float = INERTIA
    seconds: float = 3.0
    noise: float = NOISE
    #: By which the moment is recorded late, s.
    delay: float = 0.0
    frequencies: tuple = FREQUENCIES
    levels: tuple = LEVELS

    def moment(self, angle, rate):
        """Return the moment of the terms that are known by id."""
        basis = {
            "linear_stiffness": angle,
            "quadratic_stiffness": angle**2,
            "cubic_stiffness": angle**3,
            "linear_damping": rate,
            "coulomb_friction": np.sign(rate),
        }
        return sum(value * basis[name] for name, value in self.law.items())

    def runs(self, seed=0) -> list[Run]:
        """Return the runs of all frequencies and levels."""
        rng, made = np.random.default_rng((seed, 41)), []
        for frequency in self.frequencies:
            for i, level in enumerate(self.levels):
                moment, angle = self._run(frequency, level)
                moment = moment + self.noise * moment.std() * rng.normal(size=moment.size)
                angle = angle + self.noise * angle.std() * rng.normal(size=angle.size)
                made.append(Run(f"{frequency:g}Hz-{i}", frequency, level, moment, angle))
        return made

    def _run(self, frequency, level):
        w, time = 2 * np.pi * frequency, np.arange(0, self.seconds, 1 / RATE)
        # Reversals between the samples.
        phase = 0.1

        def motion(t):
            return level * np.sin(w * t + phase), level * w * np.cos(w * t + phase)

        angle, rate = motion(time)
        moment = -self.inertia * w**2 * angle + self.moment(angle, rate)
        if self.hidden:
            moment = moment + self.hidden(angle, rate, time)
        if self.states:
            count, slope, total = self.states
            # Two periods before the record, so that it begins in the steady state.
            solved = solve_ivp(
                lambda t, z: slope(t, *motion(t), z), (-2 / frequency, time[-1]), np.zeros(count), t_eval=time,
                method="LSODA", rtol=1e-7, atol=1e-10, max_step=0.01 / frequency,
            )  # fmt: skip
            moment = moment + total(angle, rate, solved.y)
        return moment, motion(time + self.delay)[0]


def write(
    folder: Path, runs: list[Run], motion="rotation", inertia=INERTIA, name="bench joint", **units
) -> Path:
    """Write a campaign of CSV files; units (moment, angle) and the rate may be declared wrongly."""
    folder.mkdir(parents=True, exist_ok=True)
    words = {"rate": f"{RATE:g}", **UNITS[motion], **units}
    text = MANIFEST.format(name=name, motion=motion, inertia=inertia, **words)
    for run in runs:
        np.savetxt(
            folder / f"{run.name}.csv", np.column_stack([run.moment, run.angle]), "%.9g", ",",
            header="moment,angle", comments="",
        )  # fmt: skip
        text += f'[[run]]\nfile = "{run.name}.csv"\nfrequency = {run.frequency}\nlevel = "{run.level:g}"\n{run.extra}'
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return folder
