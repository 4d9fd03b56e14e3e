"""Samples with an order and no time: the travelled path in its place, laws without rate, hysteresis along it.

The truth comes from a stack of sliders that is followed here sample by sample, in NumPy, and from closed forms.
"""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

import sindyjoint
from sindyjoint import Campaign, JointModel, compare, verify
from sindyjoint.cli import make_app
from sindyjoint.diagnosis import load_effects
from sindyjoint.equation import Form, is_rate_free, load_catalogue, rate_free, without_rate
from sindyjoint.errors import InputError
from sindyjoint.measurement import along_path, reversals, travelled, white_noise
from sindyjoint.states import force_states, group_labels

K1, K3, M_F = 6066.0, -2.684e8, 0.9
K_T, YIELD = 4000.0, 1.5e-4


def cycles(level, samples=400, count=3):
    return 4e-4 * level * np.sin(2 * np.pi * count * np.arange(samples * count + 1) / (samples * count))


def slider(angle, stiffness, limit):
    z = [0.0]
    for step in np.diff(angle):
        z.append(min(max(z[-1] + step, -limit), limit))
    return stiffness * np.array(z)


def rough(values, seed, share=0.01):
    return values + share * np.std(values) * np.random.default_rng(seed).standard_normal(values.size)


def made(moment_of, shuffled=False, **options):
    angles, moments = [], []
    for level in (1, 2, 3):
        angle = cycles(level)
        moment = moment_of(angle)
        order = np.random.default_rng(level).permutation(angle.size) if shuffled else np.arange(angle.size)
        angles.append(rough(angle, level, 0.003)[order])
        moments.append(rough(moment, 10 + level)[order])
    return Campaign.from_arrays(moment=moments, angle=angles, time=None, **options)


def coulomb(angle):
    return K1 * angle + K3 * angle**3 + M_F * np.sign(np.gradient(angle))


def chain(angle):
    return K1 * angle + slider(angle, K_T, YIELD)


@pytest.fixture(scope="module")
def found():
    return sindyjoint.discover(made(coulomb))


def test_the_path_of_a_triangle_is_its_length_and_the_direction_its_sign():
    angle = np.concatenate([np.linspace(0, 2, 201), np.linspace(2, -1, 301)[1:], np.linspace(-1, 0, 101)[1:]])
    path = along_path(3 * angle, angle)
    # A reversal is the last sample of one branch and the first of the next.
    assert path.step * (path.angle.size - 3) == pytest.approx(6.0)
    assert np.allclose(path.moment[path.valid], 3 * path.angle[path.valid], atol=1e-12)
    _, corners, angles = travelled(angle)
    assert corners == pytest.approx([0, 2, 5, 6]) and angles == pytest.approx([0, 2, -1, 0])


def test_moments_between_few_samples_are_those_of_the_law():
    """45 samples a cycle of a softening spring with friction: rows stand where the samples of each step lie.

    Rows at even steps miss by 0.01 % of the RMS by a parabola and by 0.29 % by straight lines, some over a reversal.
    """
    angle = 5e-4 * np.sin(2 * np.pi * np.arange(136) / 45 + 0.3)
    path = along_path(coulomb(angle), angle)
    law = K1 * path.angle + K3 * path.angle**3 + M_F * np.sign(np.gradient(path.angle))
    assert path.valid.sum() > 40
    assert np.std((path.moment - law)[path.valid]) < 5e-5 * np.std(law[path.valid])


def test_intervals_hold_what_leaving_out_a_term_does():
    """40 samples a cycle at 3 % noise show no cubic stiffness, and the linear one makes up for it: seeds 0 to 19.

    Of noise alone 4 of the intervals hold; with it 16 do, and 14 are asked for.
    """
    k3, held, found = -3e9, 0, 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        angles = [5e-4 * level * np.sin(2 * np.pi * np.arange(121) / 40 + 0.3) for level in (0.9, 0.6, 0.35)]
        moments = [K1 * angle + k3 * angle**3 + M_F * np.sign(np.gradient(angle)) for angle in angles]
        signals = {
            name: [signal + 0.03 * np.std(signal) * rng.standard_normal(signal.size) for signal in each]
            for name, each in (("moment", moments), ("angle", angles))
        }
        model = sindyjoint.discover(Campaign.from_arrays(**signals, time=None), "paper").model
        found += "cubic_stiffness" in model
        low, high = model["linear_stiffness"].interval95
        held += low <= K1 <= high
    assert found < 5 and held >= 14


def test_noise_makes_no_reversals_and_standing_still_no_path():
    rng = np.random.default_rng(3)
    angle = np.concatenate([np.linspace(0, 1, 500), np.ones(300), np.linspace(1, 0, 500)])
    noisy = angle + 0.01 * rng.standard_normal(angle.size)
    assert white_noise(noisy) == pytest.approx(0.01, rel=0.1)
    path, corners, _ = travelled(noisy)
    assert corners.size == 3 and path[-1] == pytest.approx(2.0, abs=0.1)
    assert path[790] - path[510] < 0.1
    assert white_noise(np.sin(np.linspace(0, 9, 400))) == 0.0
    # At uneven places of two branches, a step between them: third divided differences, none across it.
    place = np.sort(rng.uniform(0, 9, 2000))
    branch = (place > 4).astype(int)
    uneven = np.sin(place) + 5 * branch + 0.01 * rng.standard_normal(place.size)
    assert white_noise(uneven, place, branch) == pytest.approx(0.01, rel=0.1)
    assert reversals(np.array([0.0, 3, 1, 4, -2]), 2.5).tolist() == [0, 3, 4]


def test_a_joint_that_does_not_move_is_refused():
    with pytest.raises(InputError, match="does not move beyond its noise"):
        along_path(np.arange(100.0), np.zeros(100))


def test_only_terms_and_elements_without_rate_are_candidates():
    assert "linear_damping" not in rate_free(load_catalogue("paper"))
    kept = rate_free(load_catalogue("extended")).ids
    assert {"coulomb_friction", "position_dependent_friction", "hard_stop"} <= set(kept)
    assert not {"stribeck_friction", "quadratic_damping", "rate_dependent_stiffness"} & set(kept)
    with pytest.raises(InputError, match="every term depends on rate or time"):
        rate_free(load_catalogue("damping"))
    forms: dict[str, Form] = {effect.id: effect.variants[0] for effect in load_effects()}
    free = {name for name, form in forms.items() if form.states and is_rate_free(form)}
    assert free == {
        "dahl_friction", "bouc_wen_hysteresis", "jenkins_element", "iwan_microslip", "backlash_play"
    }  # fmt: skip


def test_the_law_is_found_without_time(found):
    assert found.model.ids == ("linear_stiffness", "cubic_stiffness", "coulomb_friction")
    for name, true in (("k1", K1), ("k3", K3), ("M_F", M_F)):
        term = found.model[name]
        assert term.coefficient == pytest.approx(true, abs=5 * term.standard_error + 0.01 * abs(true))
    assert found.verdict.verdict == "undecided"
    assert "the samples have no time, so that viscous damping cannot be judged" in found.verdict.reason
    assert found.skew is None and not any(state.completed for state in found.states)
    shown = str(found)
    assert "not applicable, the samples have no time" in shown and "θ̈" not in shown
    assert group_labels(found.states) == [run.level for run in found.campaign.runs]


def test_the_saved_model_knows_that_it_had_no_time(found):
    again = JointModel.from_json(found.model.to_json())
    assert again.fitted.quasi_static
    timed = replace(found.model, fitted=replace(found.model.fitted, quasi_static=False))
    assert "quasi_static" not in timed.to_dict()["fitted"]


def test_a_model_is_held_against_the_path_without_what_depends_on_rate(found):
    campaign = made(coulomb)
    checked = verify(found.model, campaign, draws=0)
    assert checked.response_nrmse < 0.03 and checked.runs[0].drive == "path"
    damped = replace(
        found.model.terms[0],
        id="linear_damping",
        symbol="c1",
        formula="omega",
        unit="N*m*s/rad",
        coefficient=48.0,
    )
    whole = replace(found.model, terms=(*found.model.terms, damped), covariance=())
    assert verify(whole, campaign, draws=0).response_nrmse == pytest.approx(checked.response_nrmse)
    assert without_rate(whole)[1] == "not compared, for the samples have no time: viscous damping"


def test_a_slider_is_named_along_the_path_with_its_numbers():
    diagnosis = sindyjoint.diagnose(made(chain), advise=False)
    (slider_found,) = diagnosis.effects
    assert slider_found.name == "jenkins_element"
    assert slider_found.parameters["k_t"] == pytest.approx(K_T, rel=0.005)
    assert slider_found.parameters["theta_y"] == pytest.approx(YIELD, rel=0.005)
    assert diagnosis.final.moment < 0.2 * diagnosis.initial.moment
    whole = verify(diagnosis.whole, made(chain), draws=0)
    assert whole.response_nrmse < 0.03


def test_branches_exchanged_at_random_show_neither_hysteresis_nor_friction():
    def exchanged(angle):
        # The sample at the same angle on the way back lies as far behind the turn as this one before it.
        there = np.arange(angle.size)
        there = np.minimum((200 - there) % 400 + 400 * (there // 400), angle.size - 1)
        swap = np.random.default_rng(7).random(angle.size) < 0.5
        moment = chain(angle)
        return np.where(swap, moment[there], moment)

    discovery = sindyjoint.discover(made(exchanged))
    friction = {"coulomb_friction", "position_dependent_friction", "asymmetric_friction"}
    assert not friction & set(discovery.model.ids)
    diagnosis = sindyjoint.diagnose(made(exchanged), advise=False)
    assert not any(effect.variant.states for effect in diagnosis.effects)


def test_samples_without_order_are_no_path():
    with pytest.raises(InputError, match="run 'run 1': the joint does not move beyond its noise"):
        made(chain, shuffled=True)


def test_moments_in_another_order_give_no_model():
    rng = np.random.default_rng(0)
    angles = [cycles(level) for level in (1, 2, 3)]
    moments = [rng.permutation(chain(angle)) for angle in angles]
    campaign = Campaign.from_arrays(moment=moments, angle=angles, time=None)
    assert not sindyjoint.discover(campaign).found


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rate": 100.0}, "time=None says that the samples have no time, and rate is 100.0"),
        ({"frequency": 3.0}, "samples without time have neither a frequency nor a measured rate"),
    ],
)
def test_what_needs_time_is_refused_of_arrays(options, words):
    with pytest.raises(InputError, match=words):
        made(coulomb, **options)


def test_runs_with_and_without_time_do_not_mix():
    run = made(coulomb).runs[0]
    with pytest.raises(InputError, match="some runs have time and some have none"):
        Campaign(made(coulomb).joint, (run, replace(run, name="timed", quasi_static=False)))


MANIFEST = """
[joint]
motion = "translation"
[channels]
time = "none"
force = {{ column = "F", unit = "N" }}
displacement = {{ column = "x", unit = "mm" }}
{more}
[[run]]
file = "slow.csv"
{run}
"""


def folder(tmp_path, more="", run=""):
    x = cycles(3)
    rows = np.column_stack([rough(coulomb(x), 5), 1e3 * x])
    np.savetxt(tmp_path / "slow.csv", rows, "%.9g", ",", header="F,x", comments="")
    (tmp_path / "campaign.toml").write_text(MANIFEST.format(more=more, run=run))
    return tmp_path


def test_the_command_line_takes_samples_without_time(tmp_path, pictures):
    given = folder(tmp_path)
    assert (
        CliRunner().invoke(make_app(), ["check", str(given), "--out", str(tmp_path / "check")]).exit_code == 0
    )
    result = CliRunner().invoke(
        make_app(), ["discover", str(given), "--out", str(tmp_path / "out"), "--quiet"]
    )
    assert result.exit_code == 0 and "the samples have no time" in result.stdout
    picture = (tmp_path / "out" / "figures" / "residual.svg").read_text()
    assert "Travelled path" in picture and "Time (s)" not in picture
    assert force_states(sindyjoint.load_campaign(given).runs[0]).method == "path"


def test_rows_without_a_number_are_left_out_and_told(tmp_path):
    given = folder(tmp_path)
    file = given / "slow.csv"
    lines = file.read_text().splitlines()
    whole = sindyjoint.load_campaign(given)
    for gap in ("nan,nan", ","):
        file.write_text("\n".join([*lines[:100], gap, *lines[100:]]) + "\n")
        campaign = sindyjoint.load_campaign(given)
        assert np.array_equal(campaign.runs[0].moment, whole.runs[0].moment)
        (said,) = [each for each in campaign.warnings if each.startswith("slow.csv: of ")]
        assert " in 1" in said and said.endswith("; these rows are left out")


def test_init_takes_none_for_the_sampling_rate(tmp_path):
    given = folder(tmp_path)
    (given / "campaign.toml").unlink()
    file = given / "slow.csv"
    file.write_text(file.read_text().replace("F,x", "force_N,disp_mm", 1))
    written = sindyjoint.init(given, answers={"rate": "none"}).manifest
    assert 'time = "none"' in written.read_text()
    assert sindyjoint.load_campaign(written).quasi_static


@pytest.mark.parametrize(
    ("more", "run", "words"),
    [
        ('skew = "1 ms"', "", "skew: time = 'none' says that the samples have no time; leave it out"),
        ("", "frequency = 3.0", "samples without time have neither a frequency nor a measured rate"),
        ('rate = "1 kHz"', "", "expected time .a column, or 'none' for quasi-static samples. or rate"),
        ('[inputs]\nT = { column = "F", unit = "K", delay = "1 s" }', "", "neither a delay nor a lag"),
    ],
)
def test_keys_that_need_time_are_refused(tmp_path, more, run, words):
    with pytest.raises(InputError, match=words):
        sindyjoint.load_campaign(folder(tmp_path, more, run))


@pytest.mark.parametrize("options", [{"align": True}, {"bandwidth": 3.0}, {"states": "periodic"}])
def test_options_that_need_time_are_refused(options):
    with pytest.raises(InputError, match="no time"):
        sindyjoint.discover(made(coulomb), **options)


@pytest.mark.shared
def test_screw_of_the_public_set_is_answered(public_data, tmp_path):
    source = public_data("screw-tao-coarse")
    for file in source.glob("*.csv"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    text = (source / "campaign.toml").read_text()
    (tmp_path / "campaign.toml").write_text(text.replace('rate         = "0.5 Hz"', 'time = "none"'))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        discovery = sindyjoint.discover(tmp_path)
    assert discovery.trust.colour != "good" and discovery.verdict.verdict == "undecided"


def test_a_comparison_without_time_is_held_against_what_it_can_show(found):
    compared = compare(found.campaign, "paper", methods=["stlsq"], libraries=["paper"], replicates=10)
    assert "viscous" not in compared.agreement and compared.paper_set == "the paper's terms without rate"
    assert "linear_damping" not in compared.wanted and "linear_damping" not in compared.methods[0].missing
    assert "frequenc" not in compared.agreement and compared.parts in ("level", "run")
    # The same model, fitted in another order of sums.
    told = [
        [(light.name, light.colour, light.sentence) for light in each.trust.lights]
        for each in (compared, found)
    ]
    assert told[0] == told[1]
