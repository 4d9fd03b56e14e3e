"""One floor and one answer: what repeats shows the noise, and four verbs say the same of one campaign and model."""

import json
from dataclasses import replace

import numpy as np
import pytest

import sindyjoint
from sindyjoint.errors import InputError
from sindyjoint.judgement.trust import assess
from sindyjoint.states import campaign_states
from sindyjoint.trust import Light, Trust
from tests.recovery.random_joints import aperiodic_campaign, random_plan

RATE, FREQUENCIES, LEVELS = 400.0, (0.5, 1.0, 1.5), (0.5, 1.0)
STIFFNESS, FRICTION, SCATTER, NOISE = 2.0, 1.0, 0.06, 0.002


def ramped(frequency, level, rng, scatter=SCATTER):
    """Return moment and angle of seven cycles, three of them steady, whose friction is another in each cycle."""
    cycles = np.arange(0, 7, frequency / RATE)
    height = level * np.clip(np.minimum(cycles / 2, (7 - cycles) / 2), 0, 1)
    phase = 2 * np.pi * cycles
    angle = height * np.sin(phase)
    rate = np.gradient(angle, 1 / RATE)
    level_of_cycle = FRICTION * (1 + scatter * rng.standard_normal(7))
    moment = STIFFNESS * angle + level_of_cycle[cycles.astype(int)] * np.sign(rate)
    return moment + NOISE * rng.standard_normal(moment.size), angle + 1e-5 * rng.standard_normal(angle.size)


def campaign_of(scatter, seed=5):
    rng = np.random.default_rng(seed)
    made = [ramped(f, level, rng, scatter) for f in FREQUENCIES for level in LEVELS]
    return sindyjoint.Campaign.from_arrays(
        moment=[m for m, _ in made], angle=[a for _, a in made], rate=f"{RATE:g} Hz", inertia="0 kg*m^2",
        frequency=[f for f in FREQUENCIES for _ in LEVELS],
    )  # fmt: skip


@pytest.fixture(scope="module")
def scattered():
    return campaign_of(SCATTER)


@pytest.fixture(scope="module")
def found(scattered):
    return sindyjoint.discover(scattered)


def figures(result):
    return json.loads(json.dumps(result.to_dict()["trust"]))


def test_the_floor_is_what_steady_cycles_inside_ramps_differ_by(found):
    # Of the friction of three cycles, 6 % of 1 N·m, beside a moment of about 1.3 N·m RMS; six runs of two pairs each.
    said = figures(found)["explained"]
    expected = SCATTER * FRICTION / found.model.fitted.moment_rms
    assert expected / 1.5 < said["floor"] < 1.5 * expected
    assert "periods of one motion inside the runs" in said["sentence"]
    low, high = said["interval"]
    assert low < said["gap"] < high


def test_without_scatter_the_floor_is_the_sensor_s():
    found = sindyjoint.discover(campaign_of(0.0))
    assert figures(found)["explained"]["floor"] * found.model.fitted.moment_rms == pytest.approx(
        NOISE, rel=0.5
    )


def test_no_verb_trusts_what_rests_on_a_guess(scattered, found):
    verified = sindyjoint.verify(found.model, replace(scattered, guessed=("angle.unit = deg",)), draws=0)
    said = figures(verified)
    assert said["answer"] != "Yes" and said["data"]["colour"] == "fair"
    assert "unsettled guess" in said["data"]["sentence"]
    assert figures(found)["data"]["colour"] == "good"


def test_verbs_never_give_two_answers_of_one_model(scattered, found):
    verified = sindyjoint.verify(found.model, scattered, draws=0)
    compared = sindyjoint.compare(
        scattered, methods=["stlsq"], libraries=["paper"], replicates=10, random_state=0
    )
    first = figures(found)
    for other in map(figures, (verified, compared)):
        assert other["answer"] == first["answer"]
        for part in ("data", "explained", "predicts", "determined"):
            assert other[part] == first[part], part
    assert set(first) == {"answer", "data", "explained", "predicts", "determined", "next"}
    assert set(figures(verified)["question"]) == {"response", "held out", "range"}


def test_a_diagnosis_states_the_same_floor(scattered, found):
    diagnosed = sindyjoint.diagnose(scattered, model=found.model, advise=False, max_effects=1)
    said = figures(diagnosed)
    assert diagnosed.noise_floor.moment == said["explained"]["floor"]
    assert said["explained"]["floor"] == pytest.approx(figures(found)["explained"]["floor"], rel=0.05)
    assert "effects" in said["question"]


def test_a_model_of_another_campaign_predicts_these_runs_as_it_is(found):
    other = campaign_of(SCATTER, seed=6)
    said = figures(sindyjoint.verify(found.model, other, draws=0))
    assert "which no fit has seen" in said["predicts"]["sentence"]
    assert said["predicts"]["error"] == said["explained"]["gap"]


def test_the_worst_light_answers_and_a_question_never_does():
    good, poor = Light("data", "good", ""), Light("range", "poor", "")
    assert Trust((good,), (), (poor,)).answer == "Yes" and Trust((good, poor)).answer == "Not yet"
    assert Trust((good,), (), (poor,)).weak == {"range"}
    record = Trust((Light("explained", "fair", "gap", gap=0.1, floor=float("nan")),)).to_dict()
    assert record["explained"] == {"colour": "fair", "sentence": "gap", "gap": 0.1}


@pytest.mark.parametrize("kind", ["multisine", "sweep"])
@pytest.mark.parametrize("noise", [0.003, 0.03])
def test_the_true_law_leaves_the_noise_that_is_stated(kind, noise):
    """The floor is the sensors' noise through the operators that make the states, whatever the law excites of it.

    Seed 3; six runs of some thousand moving samples: their mean square is known to 1 %, that of the spectra's end to
    5 %. An equivalent damping that took the friction for a slope made it 1.5 to 3 times too large.
    """
    plan = random_plan(3, drive="moment", sample_rate=1000.0, duration=8.0)
    found = sindyjoint.discover(aperiodic_campaign(plan, noise, kind), "paper").trust
    assert found.explained.gap == pytest.approx(found.explained.floor, rel=0.06)
    assert found.predicts.error == pytest.approx(found.explained.floor, rel=0.06)


def test_a_run_that_stands_still_is_left_out_and_named():
    test = sindyjoint.simulate(frequencies=[3, 5], levels=[0.9, 0.5], duration=4.0, rng=0)
    rng = np.random.default_rng(0)
    idle = sindyjoint.Run("idle", rng.normal(size=2000), 1e-6 * rng.normal(size=2000), 1000.0)
    with_idle = test.with_runs((*test.runs, idle))
    found, alone = sindyjoint.discover(with_idle, "paper"), sindyjoint.discover(test, "paper")
    assert found.model.coefficients == pytest.approx(alone.model.coefficients)
    left_out = "idle left out: the velocity hardly rises above its noise in it"
    for result in (found, sindyjoint.verify(alone.model, with_idle), sindyjoint.check(with_idle)):
        assert left_out in result.warnings
    # Where all stand still, the check says so, and what follows it says the same.
    still = test.with_runs((idle,))
    checked, refused = sindyjoint.check(still), sindyjoint.discover(still)
    assert checked.soundness.verdict == "unsound" and not refused.found
    assert "no moving samples" in checked.reason and refused.reason == checked.reason
    with pytest.raises(InputError, match="no moving samples"):
        sindyjoint.discover(still, accept=["no_signal"])


def test_a_law_under_which_nothing_moves_is_held_against_nothing(scattered, found):
    """Completed by a law of too much friction a heavily damped decay may have no moving sample left."""
    at_rest = [replace(s, moving=np.zeros(s.n_samples, dtype=bool)) for s in campaign_states(scattered)]
    seen = {run.name: True for run in scattered.runs}
    lights = assess(found.model, scattered, found.soundness, seen, states=at_rest)
    words = "the model cannot be compared with these runs: under it the joint moves in none of them"
    assert [light.colour for light in lights[1:3]] == ["poor", "poor"] and lights[1].sentence == words


def prescribed(seed, lines, noise, periods=3):
    """Return a campaign of multisines of three levels, moved along a given motion: k1 θ + k3 θ³ + c1 θ̇ and noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(int(periods * 4 * RATE)) / RATE
    runs = []
    for level in (0.1, 0.2, 0.3):
        phase = 2 * np.pi * np.outer(time, lines) / 4 + rng.uniform(0, 2 * np.pi, len(lines))
        scale = level / np.sqrt(len(lines))
        angle = scale * np.sin(phase).sum(axis=1)
        rate = scale * (2 * np.pi * np.array(lines) / 4 * np.cos(phase)).sum(axis=1)
        moment = 2 * angle + 8 * angle**3 + 0.05 * rate
        runs.append([x + noise * np.std(x) * rng.standard_normal(time.size) for x in (moment, angle)])
    return sindyjoint.Campaign.from_arrays(
        moment=[m for m, _ in runs], angle=[a for _, a in runs], rate=f"{RATE:g} Hz", inertia="0 kg*m^2"
    )


def test_a_diagnosis_keeps_no_term_that_the_data_do_not_need():
    """The default library has quadratic stiffness and friction, this joint has neither: seed 4, 1 % of noise.

    A term that is zero within its error made a diagnosis answer with reservations what discovery answered with yes.
    """
    campaign = prescribed(4, range(3, 14), 0.01)
    found, diagnosed = sindyjoint.discover(campaign), sindyjoint.diagnose(campaign, advise=False)
    assert set(found.model.ids) == {"linear_stiffness", "cubic_stiffness", "linear_damping"}
    assert diagnosed.verdict == "nothing_missing" and set(diagnosed.model.ids) == set(found.model.ids)
    assert figures(diagnosed)["answer"] == figures(found)["answer"] == "good"
    given = sindyjoint.diagnose(campaign, base="paper", advise=False)
    assert "quadratic_stiffness" in given.model.ids


def test_response_and_moment_of_the_true_law_leave_their_floors_where_periods_are_averaged():
    """Multisines of three periods: simulated is the mean period, and beside it stands the mean of those measured.

    One of the three as measured left √3 of the floor. Seed 4, 2 % of noise; 1600 samples are known to 2 %.
    """
    result = sindyjoint.diagnose(prescribed(4, range(3, 14), 0.02), advise=False)
    assert result.final.response == pytest.approx(result.noise_floor.response, rel=0.15)
    assert result.final.moment == pytest.approx(result.noise_floor.moment, rel=0.15)


@pytest.mark.parametrize("seed", [8, 9])
def test_friction_that_jumps_between_samples_leaves_the_drive_unsure(seed):
    """Moved along sines, 53 to 80 samples in a period: the moment holds the jump of a reversal to half a sample.

    Near resonance its response is 2 % off, where noise explains .4 %: that is not an effect that is missing.
    """
    rng, rate, inertia = np.random.default_rng(seed), 64.0, 2 / (2 * np.pi * 1.6) ** 2
    runs, frequencies = [], [f for f in (0.8, 1.0, 1.2) for _ in range(2)]
    for frequency, level in zip(frequencies, (0.5, 1.0) * 3, strict=True):
        time, w = np.arange(int(12 / frequency * rate)) / rate, 2 * np.pi * frequency
        phase = w * time + rng.uniform(0, 6)
        angle = level * np.sin(phase)
        moment = (2 - inertia * w**2) * angle + 0.5 * np.sign(np.cos(phase))
        runs.append([x + 0.003 * np.std(x) * rng.standard_normal(x.size) for x in (moment, angle)])
    campaign = sindyjoint.Campaign.from_arrays(
        moment=[m for m, _ in runs], angle=[a for _, a in runs], rate=f"{rate:g} Hz",
        inertia=f"{inertia} kg*m^2", frequency=frequencies,
    )  # fmt: skip
    found = sindyjoint.diagnose(campaign, advise=False)
    assert found.verdict == "nothing_missing", found.reason
    assert found.final.response < found.uncertainty.response
