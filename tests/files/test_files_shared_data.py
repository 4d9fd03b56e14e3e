"""Real campaigns of other institutions go through the door, with the numbers their owners state."""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from sindyjoint.files import load_campaign, write_campaign
from sindyjoint.record import Campaign, Joint, Run

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"

# folder, motion, runs, sampling rate of the first run, samples of the first run
CAMPAIGNS = [
    ("emps", "translation", 1, 1000.0, 24841),
    ("friction-damper", "translation", 10, 1024.0, 28673),
    ("pendulum", "rotation", 1, 1000.0, 36668),
    ("silverbox", "translation", 1, 610.3515625, 65062),
    ("bouc-wen", "translation", 1, 750.0, 40960),
]


@pytest.mark.shared
@pytest.mark.parametrize(("name", "motion", "runs", "rate", "samples"), CAMPAIGNS)
def test_public_campaign_loads(name, motion, runs, rate, samples):
    if not (DATA / name).is_dir():
        pytest.skip(f"public data {name!r} is not next to the checkout")
    campaign = load_campaign(DATA / name)
    first = campaign.runs[0]
    assert (campaign.joint.motion, len(campaign.runs), first.n_samples) == (motion, runs, samples)
    assert first.sample_rate == pytest.approx(rate, rel=1e-6)


@pytest.mark.shared
def test_friction_damper_in_si():
    if not (DATA / "friction-damper").is_dir():
        pytest.skip("public data 'friction-damper' is not next to the checkout")
    run = load_campaign(DATA / "friction-damper" / "campaign.toml").runs[1]
    # Its owners report a stroke of 1 inch and near rectangular loops of 10 to 14 kN.
    assert np.abs(run.angle).max() == pytest.approx(0.0254, rel=0.05)
    assert 9e3 < np.quantile(np.abs(run.moment), 0.95) < 15e3


@pytest.mark.shared
@pytest.mark.parametrize("wrong", [0.13, 0.4, 0.75, 3.0, 5.0, 7.0, 9.0])
def test_friction_damper_with_a_wrong_frequency(wrong, tmp_path):
    if not (DATA / "friction-damper").is_dir():
        pytest.skip("public data 'friction-damper' is not next to the checkout")
    source = (DATA / "friction-damper" / "0.25Hz_1in.csv").resolve()
    (tmp_path / "campaign.toml").write_text(
        '[joint]\nmotion = "translation"\n[channels]\ntime = { column = "time_s" }\n'
        'force = { column = "force_kip", unit = "kip" }\n'
        'displacement = { column = "displacement_in", unit = "inch" }\n'
        f'[[run]]\nfile = "{source.as_posix()}"\n'
        f"frequency = {wrong}\n"
    )
    with pytest.raises(
        ValueError, match=r"is absent from the data; the largest line of the displacement is at 0.25 Hz"
    ):
        load_campaign(tmp_path)


def test_twelve_runs_are_read_quickly(tmp_path):
    # 12 runs of 10 s at 1 kHz from CSV: about 0.3 s on one core; twenty times that where a machine is busy.
    t = np.arange(10_000) / 1000
    rng = np.random.default_rng(0)
    runs = tuple(
        Run(
            f"{frequency}Hz-{level}",
            np.sin(2 * np.pi * frequency * t) + 0.01 * rng.normal(size=t.size),
            1e-3 * np.cos(2 * np.pi * frequency * t) + 1e-5 * rng.normal(size=t.size),
            1000.0,
            frequency=frequency,
        )
        for frequency in (3, 4, 5, 6)
        for level in range(3)
    )
    write_campaign(Campaign(Joint(), runs), tmp_path)
    load_campaign(tmp_path)  # pint and pydantic are imported once
    start = time.process_time()
    load_campaign(tmp_path)
    assert time.process_time() - start < 6.0


def test_the_door_imports_nothing_heavy_until_it_is_used():
    code = (
        "import sys, sindyjoint.files; "
        "heavy = {'pint', 'pydantic', 'scipy', 'pandas', 'pyarrow', 'h5py'}; "
        "print(sorted(heavy & set(sys.modules)))"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"
