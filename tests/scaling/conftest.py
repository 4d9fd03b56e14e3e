"""Small campaigns of joints that differ, written once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

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


def write_joint(folder: Path, number: int, k1=6000.0, c1=50.0, temperature=20.0) -> None:
    """Write two runs of a joint of stiffness, damping and friction, moved by a sine, with 0.5 % noise."""
    rng = np.random.default_rng(1000 + number)
    folder.mkdir(parents=True)
    time = np.arange(0, 3, 2e-3)
    for name, frequency, level in (("low", 3.0, 4e-4), ("high", 5.0, 7e-4)):
        turn = 2 * np.pi * frequency
        angle, rate = level * np.sin(turn * time), level * turn * np.cos(turn * time)
        moment = -0.02 * turn**2 * angle + k1 * angle + c1 * rate + 1.9 * np.sign(rate)
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


@pytest.fixture(scope="session")
def joints(tmp_path_factory) -> Path:
    """Seven joints: the stiffness falls with temperature, the damping of one is half as large again."""
    root = tmp_path_factory.mktemp("joints")
    rng = np.random.default_rng(3)
    for number, temperature in enumerate([30, -40, 70, 0, -20, 50, 10]):
        k1 = 6000.0 * (1 - 0.002 * temperature) * (1 + 0.002 * rng.normal())
        write_joint(root / f"joint-{number}", number, k1, 75.0 if number == 4 else 50.0, temperature)
    return root
