"""Gravity beside the powers of the angle: a candidate where the joint turns far enough to tell them apart."""

from pathlib import Path

import numpy as np
import pytest

from sindyjoint import discover
from sindyjoint.record import Campaign, Joint, Run

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
RATE = 200.0


def pendulum(largest, elastic=0.0):
    """A damped pendulum under prescribed sinusoids with 0.5 % of noise; 10 N·m of gravity, seed 8."""
    rng = np.random.default_rng(8)
    runs = []
    for frequency in (0.5, 0.8, 1.1):
        for level in (1.0, 0.7, 0.4):
            time = np.arange(0, 16, 1 / RATE)
            w = 2 * np.pi * frequency
            angle, rate = largest * level * np.sin(w * time), largest * level * w * np.cos(w * time)
            moment = 10.0 * np.sin(angle) + 0.4 * rate + 0.3 * np.sign(rate) + elastic * angle
            noisy = [x + 0.005 * np.std(x) * rng.standard_normal(x.size) for x in (moment, angle)]
            runs.append(
                Run(f"{frequency:g}-{level:g}", *noisy, RATE, frequency=frequency, level=f"{level:g}")
            )
    return Campaign(Joint(inertia=0.0), tuple(runs))


def test_a_pendulum_is_one_term_and_no_series_of_powers():
    found = discover(pendulum(1.2))
    assert set(found.model.ids) == {"gravity_moment", "linear_damping", "coulomb_friction"}
    assert found.model["gravity_moment"].coefficient == pytest.approx(10.0, rel=0.005)
    assert "gravity_moment" not in discover(pendulum(0.1)).model.ids


@pytest.mark.shared
@pytest.mark.slow
def test_the_published_pendulum():
    """Its owners report m·g·a/J of 64.22 1/s²; the record is of unit inertia."""
    if not (DATA / "pendulum").is_dir():
        pytest.skip("public data 'pendulum' is not next to the checkout")
    found = discover(DATA / "pendulum")
    assert found.model["gravity_moment"].coefficient == pytest.approx(64.22, rel=0.005)
    assert not {"linear_stiffness", "quadratic_stiffness", "cubic_stiffness"} & set(found.model.ids)
