"""Eqs. 1–3 against hand-made numbers, and backwards against forwards."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sindyjoint.errors import InputError
from sindyjoint.rig import SensorRig, bending_moment, full_bridge_strain, joint_angle

positive = st.floats(1e-3, 1e4)
signals = st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=5).map(np.array)


def test_equation_1_rejects_axial_strain_and_temperature():
    # Bending gives +ε, +ε, −ε, −ε; axial strain and temperature give all four the same, and cancel.
    axial = 7e-5
    bridge = full_bridge_strain([2e-5 + axial], [2e-5 + axial], [-2e-5 + axial], [-2e-5 + axial])
    np.testing.assert_allclose(bridge, [2e-5], rtol=1e-12)


def test_equation_2_is_the_beam_formula():
    # 1.02 · 2 · 2333 N·m² · 1e-5 / 0.02 m, by hand.
    np.testing.assert_allclose(bending_moment([1e-5], 2333.0, 0.02, 1.02), [2.37966], rtol=1e-12)


def test_equation_3_averages_the_two_upper_spots():
    np.testing.assert_allclose(joint_angle([3e-5], [5e-5], [1e-5], joint_length=0.06), [5e-4], rtol=1e-12)


def test_base_motion_drops_out():
    rig = SensorRig(2333.0, 0.02, 0.06)
    theta = np.array([1e-4, -2e-4])
    spots = rig.displacements(theta, base=[3e-3, -1e-3])
    np.testing.assert_allclose(rig.angle(spots), theta, rtol=1e-10)


@settings(deadline=None)
@given(positive, positive, positive, positive, signals)
def test_backwards_then_forwards_returns_the_signal(stiffness, height, length, factor, signal):
    rig = SensorRig(stiffness, height, length, factor)
    np.testing.assert_allclose(rig.moment(rig.strains(signal)), signal, rtol=1e-12, atol=1e-300)
    np.testing.assert_allclose(rig.angle(rig.displacements(signal)), signal, rtol=1e-12, atol=1e-300)


@pytest.mark.parametrize(
    "name", ["bending_stiffness", "section_height", "joint_length", "strain_position_factor"]
)
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_impossible_constant_is_named(name, value):
    good = {"bending_stiffness": 2333.0, "section_height": 0.02, "joint_length": 0.06}
    with pytest.raises(InputError, match=rf"{name} is .*; expected a finite number above zero"):
        SensorRig(**(good | {name: value}))
