"""``acceleration`` of a campaign: units, gain, delay, alone or beside an angle; written, read, drafted, from arrays."""

import numpy as np
import pytest

from sindyjoint import Campaign, init
from sindyjoint.errors import InputError, UnitError
from sindyjoint.files import load_campaign, write_campaign

RATE, ANGULAR = 500.0, 2 * np.pi * 4
TIME = np.arange(3000) / RATE
ANGLE = 0.01 * np.sin(ANGULAR * TIME)
ACCELERATION = -(ANGULAR**2) * ANGLE
MOMENT = 60 * ANGLE + 0.2 * np.sign(np.cos(ANGULAR * TIME))
GRAVITY = 9.80665

ROTATION = """
[joint]
inertia = "0 kg*m^2"
[channels]
time = {{ column = "t", unit = "s" }}
moment = {{ column = "M", unit = "N*m" }}
{motion}
[[run]]
file = "run.csv"
frequency = 4
"""
TRANSLATION = ROTATION.replace("[joint]", '[joint]\nmotion = "translation"').replace("inertia", "mass")
TRANSLATION = TRANSLATION.replace("kg*m^2", "kg").replace("moment =", "force =").replace('"N*m"', '"N"')


@pytest.fixture
def read(tmp_path):
    def load(motion, acceleration, template=ROTATION):
        rows = np.column_stack([TIME, MOMENT, ANGLE, acceleration])
        np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header="t,M,a,acc", comments="")
        (tmp_path / "campaign.toml").write_text(template.format(motion=motion))
        return load_campaign(tmp_path)

    return load


def amplitude(signal):
    return 2 * abs(np.mean((signal * np.exp(-1j * ANGULAR * TIME[: signal.size]))[:2500]))


@pytest.mark.parametrize(
    ("template", "unit", "factor"),
    [
        (ROTATION, 'unit = "rad/s^2"', 1.0),
        (ROTATION, 'unit = "deg/s^2"', 180 / np.pi),
        (ROTATION, 'unit = "g", gain = "5 rad/m"', 1 / (5 * GRAVITY)),
        (ROTATION, 'unit = "V", gain = "20 rad/s^2/V"', 1 / 20),
        (TRANSLATION, 'unit = "m/s^2"', 1.0),
        (TRANSLATION, 'unit = "g"', 1 / GRAVITY),
        (TRANSLATION, 'unit = "mV", gain = "1 g/(100 mV)"', 100 / GRAVITY),
    ],
)
def test_units_of_an_acceleration(read, template, unit, factor):
    if "100 mV" in unit:
        unit = unit.replace("1 g/(100 mV)", "0.01 g/mV")
    campaign = read(f'acceleration = {{ column = "acc", {unit} }}', ACCELERATION * factor, template)
    assert amplitude(campaign.runs[0].angle) == pytest.approx(0.01, rel=1e-3)
    assert not campaign.mean_known


def test_beside_an_angle_the_mean_is_known_and_the_delay_removed(read):
    angle = 'angle = { column = "a", unit = "rad" }\n'
    late = -(ANGULAR**2) * 0.01 * np.sin(ANGULAR * (TIME - 3e-3))
    run = read(
        angle + 'acceleration = { column = "acc", unit = "rad/s^2", delay = "3 ms", noise = "0.1 rad/s^2" }',
        late,
    ).runs[0]
    assert run.fusion.mean_known and run.fusion.noise == pytest.approx(0.1)
    lost = (TIME.size - run.n_samples) // 2
    assert run.angle == pytest.approx(ANGLE[lost : lost + run.n_samples], abs=2e-5)


@pytest.mark.parametrize(
    ("motion", "error", "message"),
    [
        ("", InputError, "key 'angle' is missing, or acceleration in its place"),
        ('acceleration = { constant = "0 rad/s^2" }', InputError, "acceleration: expected a column"),
        ('acceleration = { column = "acc", unit = "g" }', UnitError, "gain = '5 rad/m'"),
        (
            'acceleration = { column = "acc", unit = "rad/s^2", delay = "3 s" }',
            InputError,
            "removing '3 s' takes",
        ),
        ('acceleration = { column = "acc", unit = "mm" }', UnitError, "an angular acceleration"),
    ],
)
def test_refusals(read, motion, error, message):
    with pytest.raises(error) as refused:
        read(motion, ACCELERATION)
    assert message in str(refused.value)


@pytest.mark.parametrize("beside", ["", 'angle = { column = "a", unit = "rad" }\n'])
def test_what_is_written_reads_back(read, tmp_path, beside):
    campaign = read(beside + 'acceleration = { column = "acc", unit = "rad/s^2" }', ACCELERATION)
    write_campaign(campaign, tmp_path / "again")
    again, before = load_campaign(tmp_path / "again").runs[0], campaign.runs[0]
    assert again.angle == pytest.approx(before.angle, abs=1e-9)
    assert again.moment == pytest.approx(before.moment, abs=1e-9)
    assert (again.fusion.angle is None) == (before.fusion.angle is None)


def test_from_arrays_and_frames():
    alone = Campaign.from_arrays(moment=MOMENT, acceleration=ACCELERATION, rate=RATE)
    both = Campaign.from_arrays(
        force=MOMENT,
        displacement=ANGLE,
        acceleration=ACCELERATION / GRAVITY,
        rate=RATE,
        units={"acceleration": "g"},
    )
    assert alone.joint.motion == "rotation" and both.joint.motion == "translation"
    for campaign in (alone, both):
        assert campaign.runs[0].frequency == pytest.approx(4)
        assert amplitude(campaign.runs[0].angle) == pytest.approx(0.01, rel=1e-3)
    frame = {"t [s]": TIME, "torque [N*m]": MOMENT, "acc [rad/s^2]": ACCELERATION}
    assert Campaign.from_frames({"r": frame}).runs[0].fusion is not None
    # Beside an angle it is used where it is named.
    frame["angle [rad]"] = ANGLE
    assert Campaign.from_frames({"r": frame}).runs[0].fusion is None
    assert (
        Campaign.from_frames({"r": frame}, columns={"acceleration": "acc [rad/s^2]"}).runs[0].fusion
        is not None
    )


def test_init_takes_an_acceleration_where_there_is_no_angle(tmp_path):
    rows = np.column_stack([TIME, MOMENT, ACCELERATION])
    np.savetxt(
        tmp_path / "4Hz.csv", rows, delimiter=",", header="time [s],moment [N*m],acc [rad/s^2]", comments=""
    )
    draft = init(tmp_path).draft
    assert draft.channels["acceleration"] == '{ column = "acc [rad/s^2]", unit = "rad/s^2" }'
    assert "angle" not in draft.channels and draft.runs[0].frequency == pytest.approx(4)
