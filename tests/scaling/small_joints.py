"""Writes campaigns of two short runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

MANIFEST = """
[joint]
name = "hinge"
inertia = "0.02 kg*m^2"
temperature = "{temperature} degC"
serial = "H-{number:03d}"

[channels]
rate = "500 Hz"
moment = {{ column = "moment", unit = "N*m" }}
angle = {{ column = "angle", unit = "rad" }}

[[run]]
file = "low.csv"
frequency = 3.0
[[run]]
file = "high.csv"
frequency = 5.0
"""


def write_joint(folder: Path, number: int, k1=6000.0, c1=50.0, temperature=20.0, k3=0.0) -> None:
    """Write two runs of a joint of stiffness, damping and friction, moved by a sine, with 0.5 % noise."""
    rng = np.random.default_rng(1000 + number)
    folder.mkdir(parents=True)
    time = np.arange(0, 3, 2e-3)
    for name, frequency, level in (("low", 3.0, 4e-4), ("high", 5.0, 7e-4)):
        turn = 2 * np.pi * frequency
        angle, rate = level * np.sin(turn * time), level * turn * np.cos(turn * time)
        moment = -0.02 * turn**2 * angle + k1 * angle + k3 * angle**3 + c1 * rate + 1.9 * np.sign(rate)
        angle = angle + 0.005 * angle.std() * rng.normal(size=time.size)
        moment = moment + 0.005 * moment.std() * rng.normal(size=time.size)
        np.savetxt(
            folder / f"{name}.csv",
            np.column_stack([moment, angle]),
            delimiter=",",
            header="moment,angle",
            comments="",
        )
    (folder / "campaign.toml").write_text(
        MANIFEST.format(temperature=temperature, number=number), encoding="utf-8"
    )


def content(folder: Path) -> dict[str, bytes]:
    """Return the bytes of every file of a folder by its path."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}
