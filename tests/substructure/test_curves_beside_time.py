"""``sindyjoint.curves`` of a rig beside an independent time integration, at and beside the peak."""

from dataclasses import replace
from itertools import groupby

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import sindyjoint
from sindyjoint.mechanics import PaperLaw, load_rig, with_laws
from tests.substructure.moreau import steady

PULSE_RIG = load_rig("pulse-rig")
FRICTION_ALONE = with_laws(
    replace(
        PULSE_RIG,
        items=tuple(
            replace(item, loss_factor=0.0) if hasattr(item, "loss_factor") else item
            for item in PULSE_RIG.items
        ),
    ),
    lambda hinge: PaperLaw(k1=6.066e3, M_F=1.867, name="joint"),
)


@pytest.mark.parametrize(
    ("rig", "law", "loss", "cases", "periods"),
    [
        (
            PULSE_RIG, (6.066e3, -1.927e5, -2.684e9, 48.13, 1.867), 0.004,
            [(0.41, 4.37), (0.41, 4.413), (0.41, 4.46), (0.83, 4.2), (0.83, 4.251), (0.83, 4.3)], 40,
        ),
        (FRICTION_ALONE, (6.066e3, 0.0, 0.0, 0.0, 1.867), 0.0, [(0.37, 4.378), (0.37, 4.42)], 60),
    ],
    ids=["pulse rig", "friction alone"],
)  # fmt: skip
def test_a_response_is_that_of_another_time_integration(rig, law, loss, cases, periods):
    # From 400 to 800 steps a period the integration moves by less than 0.1 % in these cases.
    truth, _ = steady(law, loss, cases, periods, steps=400)
    for force, group in groupby(zip(cases, truth, strict=True), key=lambda each: each[0][0]):
        asked, amplitudes = zip(*((frequency, amplitude) for (_, frequency), amplitude in group), strict=True)
        # The last point of a curve lies inside its band.
        (found,) = sindyjoint.curves(rig, levels=[force], band=(asked[0], 1.01 * asked[-1]), modes=1).levels
        assert found.frequency[0] == pytest.approx(asked[0]) and found.frequency[-1] > asked[-1]
        between = CubicSpline(found.frequency, found.amplitude)(asked)
        assert between == pytest.approx(amplitudes, rel=2e-3)


def test_a_rig_that_its_joints_friction_alone_damps_has_its_curves():
    found = sindyjoint.curves(FRICTION_ALONE, levels=[0.37], harmonics=5)
    assert [mode.angle[0, -1] > 0.01 for mode in found.modes] == [True, True]
    assert found.levels[0].frequency[-1] > 1.1 * found.locked[0]
    # The friction takes 4·M_F·θ per cycle, and the force gives π·F·a.
    mode = found.modes[1]
    slides = mode.angle[0] > 1e-4
    given = np.pi * mode.force[slides] * mode.amplitude[slides]
    assert given == pytest.approx(4 * 1.867 * mode.angle[0, slides], rel=0.01)
