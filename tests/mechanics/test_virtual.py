"""Virtual tests: what is driven, what the sensors make of it, and what can be found again."""

import numpy as np
import pytest

from sindyjoint import simulate
from sindyjoint.errors import InputError, UnknownNameError
from sindyjoint.mechanics import INTER_PANEL, PANEL_ROOT, PaperLaw


@pytest.mark.parametrize("drive", ["moment", "rig", "displacement"])
@pytest.mark.parametrize("joint", ["inter-panel", "panel-root"])
def test_levels_are_peak_angles(drive, joint):
    limit = {"inter-panel": INTER_PANEL, "panel-root": PANEL_ROOT}[joint].softening_angle
    campaign = simulate(joint, drive=drive, noise=0.0, frequencies=[3, 6], levels=[0.92, 0.4])
    reached = [np.abs(run.angle).max() / limit for run in campaign.runs]
    # 1 %: near its resonance the rig's beats are not over when the amplitude is sought
    np.testing.assert_allclose(reached, [0.92, 0.4, 0.92, 0.4], rtol=0.01)
    assert campaign.simulated
    assert campaign.joint.inertia == 0.02
    assert {run.n_samples for run in campaign.runs} == {10_000}


@pytest.mark.parametrize("drive", ["moment", "rig", "displacement"])
def test_moving_samples_hold_the_five_coefficients(drive):
    campaign = simulate(drive=drive, noise=0.0, frequencies=[4], levels=[0.9, 0.4], settling=10.0)
    rows, targets = [], []
    for run in campaign.runs:
        n = round(run.sample_rate / run.frequency)
        angle = run.angle[: n * (run.n_samples // n)].reshape(-1, n).mean(axis=0)
        moment = run.moment[: n * (run.n_samples // n)].reshape(-1, n).mean(axis=0)
        step = 1 / run.sample_rate
        rate = (np.roll(angle, -1) - np.roll(angle, 1)) / (2 * step)
        acceleration = (np.roll(angle, -1) - 2 * angle + np.roll(angle, 1)) / step**2
        moving = np.abs(rate) > 0.15 * np.abs(rate).max()
        rows.append(np.stack([angle, angle**2, angle**3, rate, np.sign(rate)], axis=1)[moving])
        targets.append((moment - INTER_PANEL.inertia * acceleration)[moving])
    matrix, target = np.concatenate(rows), np.concatenate(targets)
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    found = np.linalg.lstsq(matrix / scale, target, rcond=None)[0] / scale
    # 1 %: central differences of a motion with corners, as they are near breakaway
    np.testing.assert_allclose(found, INTER_PANEL.parameters, rtol=0.01)


def test_random_state_rules_the_noise():
    plan = {"frequencies": [4], "levels": [0.6], "duration": 2.0}
    one, same, other = (simulate(random_state=s, **plan).runs[0] for s in (1, 1, 2))
    clean = simulate(noise=0.0, **plan).runs[0]
    np.testing.assert_array_equal(one.moment, same.moment)
    assert not np.array_equal(one.moment, other.moment)
    for signal in ("moment", "angle"):
        level = np.std(getattr(one, signal) - getattr(clean, signal)) / np.sqrt(
            np.mean(getattr(clean, signal) ** 2)
        )
        # 2000 samples: the standard deviation of white noise is known to 1.6 %; 8 % is five of those
        assert level == pytest.approx(0.01, rel=0.08)


def test_the_time_delay_is_that_of_the_moment():
    plan = {"frequencies": [4], "levels": [0.6], "duration": 2.0, "noise": 0.0}
    plain, late = (simulate(skew=s, **plan).runs[0] for s in (0.0, 2e-3))
    np.testing.assert_array_equal(plain.angle.round(12), late.angle.round(12))
    np.testing.assert_allclose(late.moment[10:], plain.moment[8:-2], atol=1e-4)


def test_gain_and_zero_errors():
    plan = {"frequencies": [4], "levels": [0.6], "duration": 2.0, "noise": 0.0}
    plain = simulate(**plan).runs[0]
    wrong = simulate(angle_offset=2e-5, moment_gain=1.03, angle_gain=0.98, **plan).runs[0]
    np.testing.assert_allclose(wrong.angle, 0.98 * plain.angle + 2e-5, rtol=1e-12)
    np.testing.assert_allclose(wrong.moment, 1.03 * plain.moment, rtol=1e-12)


def test_hidden_effect_acts_through_the_law():
    def quintic(theta, omega, direction, state, parameters, out):
        out[0] = parameters[0] * theta**5

    from sindyjoint.mechanics import FunctionLaw

    plan = {"frequencies": [4], "levels": [0.9], "duration": 2.0, "noise": 0.0, "drive": "displacement"}
    plain = simulate(**plan).runs[0]
    richer = simulate(hidden=FunctionLaw(quintic, (1e15,)), **plan).runs[0]
    np.testing.assert_allclose(richer.moment - plain.moment, 1e15 * plain.angle**5, atol=1e-9)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"joint": "elbow"}, UnknownNameError, "expected one of inter-panel, panel-root"),
        ({"drive": "hammer"}, InputError, "'moment', 'rig' or 'displacement'"),
        ({"frequencies": []}, InputError, "frequencies are \\(\\)"),
        ({"levels": [0.5, 0.5]}, InputError, "each may be named once"),
        ({"levels": [-0.5]}, InputError, "at least one positive number"),
        ({"noise": -0.1}, InputError, "noise is -0.1"),
        ({"quantisation": 2}, InputError, "expected 4 to 32"),
        ({"sample_rate": 20}, InputError, "ten samples per period"),
        ({"duration": 0}, InputError, "duration is 0"),
        ({"settling": -1}, InputError, "settling is -1"),
        ({"skew": 0.5}, InputError, "less than half a period"),
        ({"joint": PaperLaw(k1=1e3, c1=1.0)}, InputError, "give angle_limit in rad"),
    ],
)
def test_bad_plans_report_what_is_expected(options, error, message):
    with pytest.raises(error, match=message):
        simulate(**options)
