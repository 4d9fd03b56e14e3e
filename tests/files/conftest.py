"""A small campaign on disk that each test bends in one place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sindyjoint.errors import SindyJointError

RATE, FREQUENCY, SAMPLES = 200.0, 4.0, 400

MANIFEST = """
[joint]
name = "bench"
inertia = "0.02 kg*m^2"

[channels]
time = { column = "t", unit = "s" }
moment = { column = "m", unit = "N*m" }
angle = { column = "a", unit = "mrad" }

[[run]]
file = "run.csv"
frequency = 4.0
level = "low"
"""


def signals(samples: int = SAMPLES, rate: float = RATE) -> dict[str, np.ndarray]:
    """Time in s, moment in N·m and angle in mrad at 4 Hz, with a little noise (seed 0)."""
    rng = np.random.default_rng(0)
    t = np.arange(samples) / rate
    phase = 2 * np.pi * FREQUENCY * t
    noise = rng.normal(scale=0.01, size=(2, samples))
    return {"t": t, "m": 5 * np.sin(phase) + noise[0], "a": np.sin(phase - 0.3) + noise[1]}


def csv_text(columns: dict[str, np.ndarray]) -> str:
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]) + "\n"


class Bench:
    """A folder with ``campaign.toml`` and ``run.csv`` as the test wants them."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.columns = signals()
        self.manifest(MANIFEST)
        self.csv(csv_text(self.columns))

    def manifest(self, text: str) -> Bench:
        (self.folder / "campaign.toml").write_text(text, encoding="utf-8")
        return self

    def replace(self, old: str, new: str) -> Bench:
        assert old in MANIFEST
        return self.manifest(MANIFEST.replace(old, new))

    def csv(self, text: str | bytes, name: str = "run.csv") -> Bench:
        data = text.encode("utf-8") if isinstance(text, str) else text
        (self.folder / name).write_bytes(data)
        return self

    def table(self, columns: dict[str, np.ndarray]) -> Bench:
        """Write run.csv from columns."""
        return self.csv(csv_text(columns))

    def line(self, number: int, text: str) -> Bench:
        """Replace one line of run.csv, counted from 1."""
        lines = csv_text(self.columns).split("\n")
        lines[number - 1] = text
        return self.csv("\n".join(lines))

    def column(self, name: str, values: np.ndarray) -> Bench:
        return self.csv(csv_text(self.columns | {name: values}))

    def load(self):
        from sindyjoint.files import load_campaign

        return load_campaign(self.folder)

    def refusal(self) -> str:
        """Load, and return the one line that refuses; it names the data file."""
        with pytest.raises(SindyJointError) as caught:
            self.load()
        message = str(caught.value)
        assert "\n" not in message
        assert f"{self.folder / 'run.csv'}: " in message
        return message


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)
