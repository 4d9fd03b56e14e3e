"""A plan from a rough idea of the joint to a virtual test of its runs, in Python and on the command line."""

import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest

from sindyjoint import diagnose, discover, init, plan, simulate
from sindyjoint.diagnosis.campaign import rivals
from sindyjoint.diagnosis.campaign.designs import PLANNED, designs
from sindyjoint.diagnosis.campaign.problem import CampaignProblem
from sindyjoint.errors import InputError, UnitError, UnknownNameError
from sindyjoint.files import load_campaign
from sindyjoint.limits import PLANNING
from sindyjoint.mechanics import INTER_PANEL
from sindyjoint.planning import (
    PlannedRun,
    Sensors,
    half_widths,
    like_law,
    plan_text,
    planner,
    play,
    read_plan,
    rivals_of,
    run_information,
    stacked,
)
from sindyjoint.reporting import record_schema
from sindyjoint.response import model_law
from tests.diagnosis.hidden_effects import hide
from tests.equation.test_formula_evaluation import JENKINS, with_elements

FEW = replace(PLANNING, joints=3, frequencies=3)
RANGES = ["--range", "linear_stiffness=5..8 kN*m/rad", "--range", "coulomb_friction=1..3 N*m"]
SHORT = ["--drive", "angle", "--time", "40 s", "--rate", "250 Hz", "--limit", "moment=8 N*m"]


@pytest.fixture(scope="module", autouse=True)
def small():
    """Few joints: what is averaged over is not what is tested here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(planner, "PLANNING", FEW)
        patch.setattr(planner, "DRAWS", 6)
        yield


@pytest.fixture(scope="module")
def found():
    return plan(drive="angle", time=40.0, sample_rate=250.0, limits={"moment": 8.0})


def test_a_plan_fills_the_time_and_beats_the_grid(found):
    assert found.seconds == pytest.approx(40.0) and len(found.runs) == 8
    assert sum(run.duration for run in found.grid_runs) == pytest.approx(40.0)
    # The grid's runs are fewer and longer: it is compared at the same time.
    assert found.curve[-1].widest < 0.95 * found.curve[-1].grid < np.inf
    assert [step.widest for step in found.curve] == sorted((s.widest for s in found.curve), reverse=True)
    assert len({run.frequency for run in found.runs}) == 3 and not found.undetermined
    # A joint that is only like another was tested nowhere.
    assert not any("tested range" in text for text in found.warnings)


def test_it_ends_where_it_is_enough(found):
    goal = found.curve[6].highest * 1.0001
    shorter = plan(drive="angle", time=40.0, sample_rate=250.0, limits={"moment": 8.0}, until=goal)
    assert 6 <= len(shorter.runs) <= 7 and shorter.curve[len(shorter.runs) - 1].highest <= goal
    assert shorter.stop.startswith(
        f"after {len(shorter.runs)} runs 95 of 100 tests reach a widest relative half-width"
    )
    assert sum(run.duration for run in shorter.grid_runs) == pytest.approx(shorter.seconds)


def test_a_joint_with_elements_is_planned_for_its_terms():
    model = with_elements(JENKINS)
    model = replace(model, fitted=replace(model.fitted, angle=1e-5))
    found = plan(
        model=model, drive="angle", time=40.0, band=(2.0, 8.0), sample_rate=250.0, limits={"moment": 4.0}
    )
    assert any("leave the tested range: angle up to" in text and "times)" in text for text in found.warnings)
    assert len(found.runs) == 8 and set(found.to_dict()["predicted"]) == set(found.model.ids)
    assert any(text.startswith("Jenkins element: in every simulation") for text in found.warnings)
    (made,) = play(model_law(found.model), found.runs[:1], replace(found.sensors, noise=1e-9)).runs
    assert np.abs(made.moment).max() <= 4.0


@pytest.fixture(scope="module")
def made():
    """Nine runs of the inter-panel joint."""
    return simulate(frequencies=(3, 4, 6), levels=(0.85, 0.6, 0.4), duration=4.0, sample_rate=500.0)


def test_after_some_runs_they_count_and_the_goal_may_be_reached(made):
    again = plan(campaign=made, drive="angle", time=30.0, until=0.9)
    assert not again.runs and again.stop.startswith("stop: the widest relative half-width is")
    assert again.now.reached and again.now.runs == 9 and again.now.seconds == pytest.approx(36.0)
    # Rate and noise are those of the campaign, a per cent of each channel.
    moments = [run.moment for run in made.runs]
    assert again.sensors.moment == pytest.approx(0.01 * np.sqrt(np.mean(np.square(moments))), rel=0.05)
    assert again.sensors.sample_rate == 500.0
    more = plan(campaign=made, drive="angle", time=30.0)
    before = {each.id: each.half_width95 for each in again.predicted}
    assert all(each.half_width95 < before[each.id] for each in more.predicted)
    # What is expected of no further run is what was found.
    term = again.model["linear_stiffness"]
    assert before["linear_stiffness"] == pytest.approx(2.1 * term.standard_error, rel=0.3)


def test_after_one_run_what_was_thought_before_still_holds(made):
    one = replace(made, runs=made.runs[:1])
    ranges = {"linear_stiffness": (7000.0, 8000.0), "cubic_stiffness": (-2.7e9, -2.6e9)}
    next_ = plan(
        "inter-panel", campaign=one, ranges=ranges, drive="angle", band=(2.0, 8.0), time=30.0, until=0.9
    )
    # Terms that one run does not single out are kept, the goal waits for frequencies and levels.
    assert set(next_.terms) == set(next_.model.ids) and len(next_.terms) == 5
    assert next_.runs and next_.now.missing == 5 and not next_.now.reached
    at = next_.model.ids.index("cubic_stiffness")
    assert -2.7e9 <= next_.low[at] <= next_.high[at] <= -2.6e9
    # The truth is 6 kN·m/rad.
    assert any("outside of the range that was given" in text for text in next_.warnings)


@pytest.mark.parametrize("drive", ["angle", "moment"])
def test_a_setting_that_is_missing_is_all_that_is_asked_for(drive):
    """Renewed after each run, a plan put it off for ever: a test whose goal was reached did not end."""
    tested = simulate(frequencies=(2, 5, 8), levels=(0.85, 0.5), duration=4.0, sample_rate=500.0)
    few = replace(tested, runs=tested.runs[:-1])
    next_ = plan(campaign=few, drive=drive, band=(2.0, 8.0), time=60.0, run_time=5.0, until=0.9)
    assert next_.now.missing == 1 and [run.frequency for run in next_.runs] == [8.0]


def test_a_plan_is_played_and_becomes_a_campaign(found, tmp_path):
    path = tmp_path / "plan.toml"
    path.write_text(plan_text(found.runs, replace(found.sensors, angle=2e-6)))
    runs, sensors = read_plan(path)
    assert runs == found.runs and sensors.angle == 2e-6
    campaign = simulate("inter-panel", plan=tmp_path, out=tmp_path / "made")
    assert campaign.simulated and len(campaign.runs) == len(found.runs)
    for run, planned in zip(campaign.runs, found.runs, strict=True):
        assert np.abs(run.angle).max() == pytest.approx(planned.level, abs=5 * 2e-6)
        assert run.duration == pytest.approx(planned.duration)
    (tmp_path / "made" / "campaign.toml").unlink()
    init(tmp_path / "made")
    read = load_campaign(tmp_path / "made")
    assert [run.frequency for run in read.runs] == pytest.approx([run.frequency for run in found.runs])


@pytest.mark.parametrize("change, error, text", [
    (('drive = "angle"', 'drive = "force"'), InputError, "[[run]] 1 drive: expected 'moment' or 'angle', not 'force'"),
    ((" rad", " N*m"), UnitError, "run 1: level"),
    (('frequency = "', 'frequency = "-'), InputError, "expected positive numbers"),
    (("[[run]]", "[[ran]]"), InputError, "unknown key 'ran'"),
])  # fmt: skip
def test_what_is_no_plan_is_refused_by_field(found, tmp_path, change, error, text):
    (tmp_path / "plan.toml").write_text(plan_text(found.runs[:1], found.sensors).replace(*change))
    with pytest.raises(error) as refused:
        read_plan(tmp_path)
    assert text in str(refused.value) and "plan.toml" in str(refused.value)


@pytest.mark.parametrize("options, error, text", [
    ({"time": 3.0}, InputError, "time is 3 s; expected at least 4.5 s"),
    ({"limits": {"force": 1.0}}, UnknownNameError, "limit of 'force'"),
    ({"terms": ["k9"]}, UnknownNameError, "term 'k9'; the joint has linear_stiffness"),
    ({"goal": "all"}, InputError, "expected 'widths', 'frequency', 'paper' or 'tell-apart'"),
    *[({"until": until}, InputError, "expected a positive share, at most 1") for until in (0.0, 5.0)],
    ({"model": "a", "like": "panel-root"}, InputError, "a model and a joint that it is like were given"),
    ({"run_time": 2.0}, InputError, "run_time is 2 s; expected between 4.5 s"),
    ({"noise": -1.0}, InputError, "noise is -1.0; expected a positive number"),
])  # fmt: skip
def test_options_that_cannot_be_used_are_refused(options, error, text):
    with pytest.raises(error, match=text):
        plan(**options)


def test_a_plan_and_other_options_do_not_go_together(tmp_path):
    with pytest.raises(InputError, match="a plan and levels were given"):
        simulate(plan=tmp_path, levels=(0.5,))


def test_the_command_prints_its_record_and_writes_what_simulate_plays(sindyjoint, tmp_path):
    answer = sindyjoint("plan", *RANGES, *SHORT, "--noise", "angle=2 urad", "--json", "--out", tmp_path)
    assert answer.status == 0, answer.stderr
    record = json.loads(answer.stdout)
    jsonschema.validate(record, record_schema("plan"))
    assert record["runs"][0].keys() == {"drive", "waveform", "frequency", "level", "unit", "duration"}
    assert record["predicted"]["linear_stiffness"]["unit"] == "N*m/rad"
    assert record["predicted"].keys() == record["grid"].keys() >= {"coulomb_friction"}
    assert json.loads((tmp_path / "plan.json").read_text()) == record
    assert {path.stem for path in (tmp_path / "figures").glob("*.svg")} == {"runs", "curve", "widths"}
    drives = sorted(tmp_path.glob("drive-*.csv"))
    signal = np.loadtxt(drives[0], delimiter=",", skiprows=1)
    assert len(drives) == len(record["runs"]) and signal[-1, 0] == pytest.approx(5.0, abs=0.01)
    assert signal[:, 1].max() == pytest.approx(record["runs"][0]["level"], rel=0.01)
    made = sindyjoint("simulate", "--plan", tmp_path, "--out", tmp_path / "made", "--json")
    assert len(json.loads(made.stdout)["runs"]) == len(record["runs"])


@pytest.mark.parametrize("options, text", [
    (["--band", "2 Hz"], "--band is '2 Hz'; expected two numbers and their unit"),
    (["--limit", "moment"], "--limit is 'moment'; expected moment or angle or rate"),
    (["--range", "linear_stiffness=5..8 N*m"], "--range linear_stiffness"),
    (["--until", "much"], "--until is 'much'; expected a share such as 0.05 or '5 %'"),
])  # fmt: skip
def test_quantities_that_are_none_are_refused_in_one_line(sindyjoint, options, text):
    answer = sindyjoint("plan", *options)
    assert answer.status == 2 and text in answer.stderr and answer.stderr.count("\n") == 1


def test_goals_may_be_mixed_and_what_the_paper_asks_is_a_goal_of_its_own():
    options = {"drive": "angle", "time": 40.0, "sample_rate": 250.0, "limits": {"moment": 8.0}}
    found = plan(goal={"widths": 1.0, "frequency": 3.0}, **options)
    assert found.goals == (("frequency", 0.75), ("widths", 0.25)) and found.goal == "frequency"
    # From one down every term is taken by a discovery.
    terms = plan(goal="paper", until=1.0, **options)
    assert terms.curve[len(terms.runs) - 1].highest <= 1.0 and len(terms.runs) < 8
    assert terms.curve[len(terms.runs) - 1].complete == 1.0


@pytest.fixture(scope="module")
def hidden():
    """A joint with a Maxwell branch that its campaign, with 10 % noise, does not tell from a fractional damper."""
    return hide("maxwell_branch", 3999, duration=4.0, noise=0.1)


PAIR = ("maxwell_branch", "fractional_damping")


def test_effects_are_told_apart_by_the_search_of_the_advice(hidden, monkeypatch):
    judged = []
    # A part of the runs that could be made: what becomes of those that separate best is tested.
    monkeypatch.setattr(rivals, "designs", lambda *given: designs(*given)[::9])
    monkeypatch.setattr(CampaignProblem, "better_simulated", False)
    monkeypatch.setattr(
        "sindyjoint.workflows.plan.diagnosed",
        lambda *given, **options: judged.append(diagnose(*given, **options)) or judged[-1],
    )
    options = {"campaign": hidden.campaign, "goal": "tell-apart", "drive": "angle", "band": (0.75, 24.0)}
    found = plan(effects=PAIR, time=60.0, **options)
    assert found.goal == "tell-apart" and found.apart.effects == PAIR
    run = found.runs[0]
    assert run.drive == "angle" and 0.75 <= run.frequency <= 24.0 and run.unit == "rad"
    # The runs are those that a diagnosis advises for this actuator; two at most have all of the time.
    assert [(run.frequency, run.level, run.waveform) for run in found.runs] == [
        (each.frequency, each.level, PLANNED[each.waveform]) for each in judged[0].advice
    ]
    assert all(run.duration == pytest.approx(30.0) for run in found.runs)
    assert found.apart.before < found.apart.after[-1] <= 1.0
    assert "probability of the true effect" in str(found)
    record = json.loads(json.dumps(found.to_dict()))
    jsonschema.validate(record, record_schema("plan"))
    # What the actuator cannot do is not planned.
    none = plan(effects=PAIR, time=60.0, limits={"angle": 1e-9}, **options)
    assert not none.runs and "within the limits of the actuator" in none.stop
    assert "no run that can be made tells the effects apart" in str(none)


@pytest.mark.parametrize("options, text", [
    ({"effects": ("dahl_friction",)}, "expected two or more to be told apart"),
    ({"effects": ("dahl_friction", "friction")}, "no effect 'friction'"),
    ({"diagnosis": "nowhere"}, "expected the diagnosis.json of a diagnosis"),
    ({"goal": "widths", "effects": ("dahl_friction", "lugre_friction")}, "the goal is not to tell them apart"),
    ({"goal": {"widths": -1.0}}, "weight of goal 'widths' is -1.0"),
    ({"goal": {}}, "no goal was given"),
])  # fmt: skip
def test_what_cannot_be_told_apart_is_refused(options, text):
    with pytest.raises((InputError, UnknownNameError), match=text):
        plan(**{"goal": "tell-apart", **options})


def test_the_rivals_of_a_diagnosis_are_read(tmp_path):
    steps = [{"members": ["cubic_damping"]}, {"members": ["dahl_friction", "lugre_friction"]}]
    (tmp_path / "diagnosis.json").write_text(json.dumps({"steps": steps}))
    assert rivals_of(tmp_path) == ("dahl_friction", "lugre_friction")
    (tmp_path / "diagnosis.json").write_text(json.dumps({"steps": steps[:1]}))
    with pytest.raises(InputError, match="told apart already"):
        rivals_of(tmp_path)


@pytest.mark.parametrize("waveform", ["two-tone-3", "two-tone-5", "triangle", "multisine", "sweep"])
@pytest.mark.parametrize("drive, level, unit", [("angle", 5e-4, "rad"), ("moment", 3.0, "N*m")])
def test_waveforms_of_several_tones_are_played_and_read_back(tmp_path, waveform, drive, level, unit):
    run = PlannedRun(drive, waveform, 2.0, level, unit, 3.0)
    (tmp_path / "plan.toml").write_text(plan_text([run], Sensors(500.0, 1e-6)))
    runs, sensors = read_plan(tmp_path)
    assert runs == (run,)
    made = play(INTER_PANEL, runs, sensors).runs[0]
    signal = getattr(made, drive)
    assert np.abs(signal).max() == pytest.approx(level, rel=0.01)
    # A period later it is the same, and it has the tones that it is called by.
    assert signal[:250] == pytest.approx(signal[250:500], abs=1e-4 * level)
    lines = np.abs(np.fft.rfft(signal[:250]))
    order = {"two-tone-3": 3, "two-tone-5": 5, "triangle": 3, "multisine": 5, "sweep": 4}[waveform]
    # Of a sweep (J₁(2) + J₇(2))/(J₂(2) − J₄(2)).
    share = {"two-tone-3": 0.8, "two-tone-5": 0.5, "triangle": 1 / 9, "multisine": 1.0, "sweep": 1.8097}[
        waveform
    ]
    assert lines[order] / lines[1] == pytest.approx(share, rel=0.01)


def test_runs_of_a_sweep_become_a_campaign_and_tell_what_was_expected(tmp_path):
    runs = [PlannedRun("angle", "sweep", f, x, "rad", 12.0) for f in (0.8, 1.0, 1.25) for x in (3e-4, 6.5e-4)]
    sensors = Sensors(500.0, 0.01)
    (tmp_path / "plan.toml").write_text(plan_text(runs, sensors))
    simulate("inter-panel", plan=tmp_path, out=tmp_path / "made", random_state=1)
    (tmp_path / "made" / "campaign.toml").unlink()
    init(tmp_path / "made")
    read = load_campaign(tmp_path / "made")
    assert [run.frequency for run in read.runs] == pytest.approx([run.frequency for run in runs])
    found = discover(
        replace(read, joint=replace(read.joint, inertia=INTER_PANEL.inertia)), random_state=0
    ).model
    true = like_law(INTER_PANEL).model
    told = half_widths(stacked([stacked([run_information(run, true, sensors)]) for run in runs]))[0]
    for term, half in zip(true.terms, told, strict=True):
        low, high = found[term.id].interval95
        assert low < term.coefficient < high
        # Of 42 blocks, the part of a few runs in them: ±15 %.
        assert (high - low) / 2 == pytest.approx(half, rel=0.5)
