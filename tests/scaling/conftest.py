"""Small campaigns of joints that differ, written once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_joints import write_joint

from sindyjoint.workflows.batch import batch


@pytest.fixture(scope="session")
def joints(tmp_path_factory) -> Path:
    """Seven joints: the stiffness falls with temperature, the damping of one is half as large again."""
    root = tmp_path_factory.mktemp("joints")
    rng = np.random.default_rng(3)
    for number, temperature in enumerate([30, -40, 70, 0, -20, 50, 10]):
        k1 = 6000.0 * (1 - 0.002 * temperature) * (1 + 0.002 * rng.normal())
        write_joint(root / f"joint-{number}", number, k1, 75.0 if number == 4 else 50.0, temperature)
    return root


@pytest.fixture(scope="session")
def done(joints, tmp_path_factory):
    """Return a batch over them, its folder and its result."""
    out = tmp_path_factory.mktemp("done") / "out"
    return out, batch(joints, out, "paper")
