"""The law of a joint inside a structure; data by SciPy's integrator, not by the package's."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import check, discover_rig, load_rig_plan, virtual_rig_test
from sindyjoint.cli import main
from sindyjoint.equation import term_columns
from sindyjoint.errors import UnsoundError
from sindyjoint.files import ENCODERS
from sindyjoint.judgement.verdict import Verdict, of_many_rows, of_slight_terms, within_the_states
from sindyjoint.limits import SUBSTRUCTURE
from sindyjoint.paper import INTER_PANEL, TERMS
from sindyjoint.substructure import find_slow, joint_states
from sindyjoint.substructure.law_errors import law_errors
from sindyjoint.substructure.states import kept_orders, slow_part, strongest_line
from tests.doors.asked import checked_record

from .two_masses import C0, K0, M1, M2, RATE, integrated_run, rig_test

K, K3, C = 900.0, 4e6, 12.0
DRIVES = [(1.5, 2.0), (1.5, 5.0), (2.5, 2.0), (2.5, 6.0), (4.0, 6.0), (4.0, 12.0)]


def elastic(d, v):
    return K * d + K3 * d**3 + C * v


@pytest.fixture(scope="module")
def runs():
    return [
        integrated_run(f"{f:g} Hz {a:g} N", f, a, elastic, noise=0.005, seed=i)
        for i, (f, a) in enumerate(DRIVES)
    ]


@pytest.fixture(scope="module")
def found(runs):
    return discover_rig(rig_test(runs), random_state=0)


def test_the_law_of_an_elastic_joint_has_no_friction(found):
    (law,) = found.laws
    assert law.found and law.joints == ("joint",)
    model = law.discovery.model
    assert set(model.ids) == {"linear_stiffness", "cubic_stiffness", "linear_damping"}
    for term, true in zip(model.terms, (K, K3, C), strict=True):
        assert term.coefficient == pytest.approx(true, rel=0.02)
        assert abs(term.coefficient - true) < 4 * term.standard_error
    assert found.misfit == pytest.approx(1.0, abs=0.2) and found.found


def test_runs_in_which_the_structure_still_vibrates_freely_are_taken_as_records():
    """Averaged over periods their friction would be another's: the free vibration reverses the joint, too."""
    true = {"linear_stiffness": K, "cubic_stiffness": K3, "linear_damping": 1.0, "coulomb_friction": 0.2}

    def light(d, v):
        return K * d + K3 * d**3 + 1.0 * v + 0.2 * np.tanh(v / 1e-5)

    runs = [
        integrated_run(f"{f:g} Hz {a:g} N", f, a, light, noise=0.005, seed=i, settled=0.5)
        for i, (f, a) in enumerate(DRIVES[1::2])
    ]
    unsettled = discover_rig(rig_test(runs), random_state=0)
    assert "still vibrates freely" in unsettled.warnings[0] and not unsettled.refinement
    terms = unsettled.laws[0].discovery.model.terms
    assert {"linear_stiffness", "coulomb_friction"} <= {term.id for term in terms} <= true.keys()
    for term in terms:
        assert abs(term.coefficient - true[term.id]) < 4 * term.standard_error


def test_no_term_is_shown_whose_interval_holds_zero(runs):
    """However many are taken by their share: all of them go, none is asked for and forbidden at once."""
    (law,) = discover_rig(rig_test(runs), random_state=0, threshold=1e-4).laws
    assert {"linear_stiffness", "cubic_stiffness", "linear_damping"} <= set(law.discovery.model.ids)
    assert all(low * high > 0 for low, high in (term.interval95 for term in law.discovery.model.terms))


def test_what_a_structure_advises_next_are_commands_that_take_a_structure(found):
    steps = [do for do, _ in (*found.trust.next_steps, *found.laws[0].discovery.trust.next_steps)]
    assert found.trust.next_steps and not any("compare" in do for do in steps)
    assert not any("export RESULTS " in do for do, _ in found.trust.next_steps)


def test_a_wrong_stiffness_of_the_structure_is_found_without_being_told(runs, found):
    """Described 5 % too stiff."""
    from .two_masses import structure

    other = discover_rig(rig_test(runs, structure=structure(1.05 * K0)), random_state=0)
    number = {each.name: each for each in other.structure}["stiffness"]
    assert abs(number.change - (1 / 1.05 - 1)) < 4 * number.standard_error < 0.005
    assert other.misfit == pytest.approx(1.0, abs=0.2) and "changed by stiffness -4.7" in other.warnings[0]
    for term, true in zip(other.laws[0].discovery.model.terms, (K, K3, C), strict=True):
        assert abs(term.coefficient - true) < 4 * term.standard_error
    assert found.structure == ()


def test_coefficients_follow_what_was_recovered_as_their_errors_say(found):
    """Refitted with other amplitudes, mean angles free, the coefficients change as the linear map says."""
    (law,) = found.laws
    terms = [t for name in law.discovery.model.ids for t in law.discovery.regressor.terms_ if t.id == name]
    weights, generator = np.array([each.weight for each in law.recovered]), np.random.default_rng(4)

    def fitted(recoveries):
        states = [joint_states(r, 0, r.run.name) for r in recoveries]
        slow = [slow_part(r, 0) for r in recoveries]
        return find_slow(states, slow, terms, weights).coefficients

    def moved(recovery):
        spectra = recovery.spectra
        more = 0.3 * np.sqrt(spectra.variance) * generator.normal(size=spectra.variance.shape)
        changed = replace(spectra, amplitudes=spectra.amplitudes + more, blocks=spectra.blocks + more)
        return replace(recovery, spectra=changed)

    before = [each.recovery for each in law.recovered]
    after = [moved(recovery) for recovery in before]
    errors = np.sqrt(np.diag(law.errors.covariance))
    change, said = (fitted(after) - fitted(before)) / errors, law.errors.change(after) / errors
    assert np.abs(said).max() > 0.02
    assert change == pytest.approx(said, abs=0.1 * np.abs(said).max())


def test_a_term_left_out_stands_out_of_the_noise_and_no_other_does(found):
    """What a further term would be is what it is once it is fitted."""
    (law,) = found.laws
    ids, resolved = law.discovery.model.ids, {t.id: t for t in law.discovery.regressor.terms_}
    states = [e.states for e in law.recovered]
    seen = [slow_part(e.recovery, e.joint) for e in law.recovered]
    slow = [replace(each, amplitudes=0 * each.amplitudes) for each in seen]

    def beside(chosen):
        rows = find_slow(
            states, slow, [resolved[i] for i in chosen], np.array([e.weight for e in law.recovered])
        )
        rest = [term for term in resolved.values() if term.id not in chosen]
        columns = [
            term_columns(rest, s.angle[k], s.rate[k], s.acceleration[k])
            for s, k in zip(states, rows.kept, strict=True)
        ]
        errors = law_errors(rows, law.recovered, slow, columns)
        own = rows.coefficients / np.sqrt(np.diag(errors.covariance))
        return own, dict(zip((t.id for t in rest), errors.others, strict=True))

    _, others = beside(ids)
    assert max(map(abs, others.values())) < SUBSTRUCTURE.stands_out
    for further in ("quadratic_stiffness", "cubic_damping", "coulomb_friction"):
        own, _ = beside([*ids, further])
        assert own[-1] == pytest.approx(others[further], rel=0.1, abs=0.05)
    _, others = beside([i for i in ids if i != "cubic_stiffness"])
    assert abs(others["cubic_stiffness"]) > SUBSTRUCTURE.stands_out


def test_no_harmonic_is_left_out_below_the_last_that_stands_out():
    amplitude = np.array([100, 1, 30, 2, 8, 0.5, 0.3, 0.2, 0.1, 0.1, 0.1, 0.1], dtype=complex)
    for tone in (True, False):
        assert kept_orders(amplitude, np.ones(12), tone).tolist() == [True] * 5 + [False] * 7


def test_a_verdict_is_no_surer_than_the_angles(found):
    """An angle known within 5 % of itself leaves the terms open; within a tenth of a per cent it changes nothing."""
    discovery = found.laws[0].discovery
    sure = replace(discovery.verdict, verdict="refuted")

    assert within_the_states(sure, 0.001, 0.0) == sure
    open_one = within_the_states(sure, 0.05, 0.0)
    assert open_one.verdict == "undecided" and "only to 5.0 %" in open_one.reason


def test_terms_that_are_there_need_no_better_angle_than_shows_that_no_other_is(found):
    discovery = found.laws[0].discovery
    confirmed = replace(discovery.verdict, verdict="confirmed")
    assert within_the_states(confirmed, 0.05, 0.001) == confirmed
    assert within_the_states(confirmed, 0.001, 0.01).verdict == "undecided"


def test_few_samples_of_motion_refute_no_term():
    """After blows a joint moved in 1003 samples, with which 342 numbers of its slow angle were found."""
    refuted = Verdict("refuted", (), ("quintic_stiffness",), "the data need quintic stiffness")
    undecided = of_many_rows(refuted, 1003, 342)
    assert undecided.verdict == "undecided" and "1003 samples" in undecided.reason
    assert of_many_rows(refuted, 2563, 404) == refuted
    confirmed = replace(refuted, verdict="confirmed", extra=())
    assert of_many_rows(confirmed, 1003, 342) == confirmed


def test_terms_that_carry_less_than_a_structure_is_known_to_refute_nothing(found):
    model = found.laws[0].discovery.model
    *_, last = model.terms
    refuted = Verdict("refuted", (), (last.id,), "the data need it")
    slight = replace(model, terms=(*model.terms[:-1], replace(last, unique_share=9e-4)))
    undecided = of_slight_terms(refuted, slight)
    assert undecided.verdict == "undecided" and "less than 0.1 % of the moment" in undecided.reason
    more = replace(model, terms=(*model.terms[:-1], replace(last, unique_share=1.1e-3)))
    assert of_slight_terms(refuted, more) == refuted
    # Terms of the paper that are not there are another matter.
    assert of_slight_terms(replace(refuted, missing=("cubic_stiffness",)), slight).verdict == "refuted"


def test_noise_of_slow_harmonics_is_not_the_motion_of_a_joint():
    """Angles of accelerometers have noise that grows as 1/ω²: larger than the motion at the first line here."""
    size, error = np.array([3.0, 0.4, 0.2, 2.0, 0.1]), np.array([1.6, 0.4, 0.18, 0.1, 0.06])
    assert strongest_line(size, error) == 3


def test_a_structure_that_is_another_one_is_seen(runs):
    from .two_masses import structure

    heavier = structure()
    # Half the second mass is missing from the description.
    missing = np.outer(heavier.point("x2"), heavier.point("x2"))
    other = discover_rig(rig_test(runs, structure=replace(heavier, mass=heavier.mass - 0.5 * M2 * missing)))
    assert other.misfit > 2
    assert any("not quite the one described" in line for line in other.warnings)
    # No law is trusted beside a misfit, neither in the structure nor alone.
    assert [each.trust.data.colour for each in (other, other.laws[0].discovery)] == ["poor", "poor"]
    assert other.to_dict()["trust"]["answer"] == "poor"
    # A mass that is another one is, with one sensor more than joints, a gain of the sensor on it.
    assert [(f.id, f.channel, f.severity) for f in other.soundness.findings] == [
        ("gain_differs", "x2", "biases")
    ]


def test_noise_alone_gives_no_law(runs):
    generator = np.random.default_rng(5)
    silent = [
        replace(
            run,
            drive=generator.normal(size=run.drive.size),
            responses=generator.normal(size=run.responses.shape),
        )
        for run in runs[:2]
    ]
    with pytest.raises(UnsoundError, match="the drive is noise"):
        discover_rig(rig_test(silent))
    (law,) = discover_rig(rig_test(silent), accept=("no_signal", "wrong_frequency")).laws
    assert not law.found
    assert law.reason or law.discovery.reason


@pytest.fixture()
def folder(tmp_path, runs):
    for number, run in enumerate(runs):
        columns = {
            "time": np.arange(run.drive.size) / RATE,
            "f": run.drive,
            "a1": run.responses[0],
            "a2": run.responses[1],
        }
        (tmp_path / f"{number}.npz").write_bytes(ENCODERS["npz"](columns, ""))
    np.savez(
        tmp_path / "matrices.npz",
        mass=np.diag([M1, M2]),
        stiffness=np.diag([K0, 0.0]),
        damping=np.diag([C0, 0.0]),
    )
    lines = [
        'name = "two masses"', "[matrices]", 'file = "matrices.npz"', 'freedoms = ["x1", "x2"]',
        'motion = "translation"', "[[matrices.joint]]", 'name = "joint"', 'between = ["x1", "x2"]',
        "[drive]", 'point = "x2"', 'column = "f"', 'unit = "N"',
        *(f'[[sensor]]\ncolumn = "a{i}"\nunit = "m/s^2"\npoint = "x{i}"' for i in (1, 2)),
        *(f'[[run]]\nfile = "{i}.npz"\nfrequency = "{run.frequency} Hz"' for i, run in enumerate(runs)),
    ]  # fmt: skip
    (tmp_path / "rig.toml").write_text("\n".join(lines))
    return tmp_path


def test_a_structure_by_its_matrices_from_the_command_line(folder, found, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["discover", f"{folder}/rig.toml", "--json", "-q", "--random-state", "0"])
    assert ended.value.code == 0
    record = json.loads(capsys.readouterr().out)
    checked_record("structure", record)
    terms = {term["id"]: term["coefficient"] for term in record["laws"][0]["discovery"]["terms"]}
    assert terms == pytest.approx(
        {t.id: t.coefficient for t in found.laws[0].discovery.model.terms}, rel=1e-6
    )


def test_the_check_of_a_folder_with_a_rig_stops_what_comes_after(folder, runs, tmp_path, capsys):
    """A sensor mounted the other way round: check and discover end with status 1, and the page is written."""
    with pytest.raises(SystemExit) as ended:
        main(["check", str(folder), "--json"])
    record = json.loads(capsys.readouterr().out)
    assert ended.value.code == 0 and (record["schema"], record["verdict"]) == (1, "sound")
    for number, run in enumerate(runs):
        columns = {"time": np.arange(run.drive.size) / RATE, "f": run.drive}
        columns |= {"a1": -run.responses[0], "a2": run.responses[1]}
        (folder / f"{number}.npz").write_bytes(ENCODERS["npz"](columns, ""))
    for command in ("check", "discover"):
        with pytest.raises(SystemExit) as ended:
            main([command, str(folder), "--json", "-q", "--out", str(tmp_path / command)])
        record = json.loads(capsys.readouterr().out)
        assert ended.value.code == 1 and record["verdict"] == "unsound"
        assert [(f["id"], f["channel"]) for f in record["findings"]] == [("reversed_sign", "a1")]
        assert (tmp_path / command / "report.html").is_file()
    with pytest.raises(SystemExit) as ended:
        main(["check", str(folder), "--json", "--accept", "reversed_sign"])
    assert ended.value.code == 0 and json.loads(capsys.readouterr().out)["verdict"] == "unsound"


def test_samples_that_a_file_lacks_are_filled_in_and_told(folder, runs, sindyjoint):
    """Two numbers that are none in a sensor, three rows that the recorder lost: other periods show what they were."""
    first, second = runs[:2]
    columns = {"time": np.arange(first.drive.size) / RATE, "f": first.drive}
    columns |= {"a1": first.responses[0].copy(), "a2": first.responses[1]}
    columns["a1"][[40, 300]] = np.nan
    (folder / "0.npz").write_bytes(ENCODERS["npz"](columns, ""))
    columns = {"time": np.arange(second.drive.size) / RATE, "f": second.drive}
    columns |= dict(zip(("a1", "a2"), second.responses, strict=True))
    short = {name: np.delete(values, [100, 101, 400]) for name, values in columns.items()}
    (folder / "1.npz").write_bytes(ENCODERS["npz"](short, ""))
    found = json.loads(sindyjoint("check", folder, "--json").stdout)["findings"]
    assert {(f["id"], f["run"], f["channel"], f["severity"]) for f in found} == {
        ("lost_samples", "0", "a1", "biases"),
        *(("lost_samples", "1", channel, "biases") for channel in ("drive", "a1", "a2")),
    }
    filled = check(folder).usable
    for mine, true in zip(filled.runs[:2], (first, second), strict=True):
        off = np.abs(mine.signals - true.signals).max(axis=1)
        assert mine.drive.size == true.drive.size and (off < 0.05 * true.signals.std(axis=1)).all()
    # Most of a sensor is not made up.
    columns["a2"] = np.where(np.arange(second.drive.size) < 800, np.nan, columns["a2"])
    (folder / "1.npz").write_bytes(ENCODERS["npz"](columns, ""))
    refused = sindyjoint("check", folder)
    assert refused.status == 2 and "column 'a2' holds nan in " in refused.stderr


def test_the_page_shows_laws_and_sensors(found, tmp_path):
    found.report(tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text()
    assert (
        "joint/report.html" in page and "times their noise" in page and "when a sensor is taken away" in page
    )
    assert json.loads((tmp_path / "out" / "structure.json").read_text())["sensors"][0]["name"] == "x1"


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ('frequency = "1.5 Hz"', 'frequency = "1.5 kg"', "kg"),
        ('between = ["x1", "x2"]', 'between = ["x1", "x3"]', "'x3' is none of the freedoms"),
        ('point = "x1"', 'point = "x9"', "point 'x9'"),
        ('unit = "m/s^2"', 'unit = "kg"', "kg"),
        ("[matrices]", "[matrizes]", "did you mean 'matrices'"),
        (
            'freedoms = ["x1", "x2"]',
            'freedoms = ["x1", "x2", "x3"]',
            "expected arrays mass and stiffness, 3 × 3",
        ),
        ('column = "a1"', 'column = "a7"', "a7"),
        ('file = "0.npz"', 'file = "no.npz"', "no.npz"),
        ('point = "x1"', 'point = { beam = "b", at = "1 m" }', "of a [[chain]]"),
    ],
)
def test_mistakes_are_one_line_that_names_them(folder, capsys, before, after, said):
    text = (folder / "rig.toml").read_text()
    assert before in text
    (folder / "rig.toml").write_text(text.replace(before, after, 1))
    with pytest.raises(SystemExit) as ended:
        main(["discover", str(folder / "rig.toml"), "-q"])
    told = capsys.readouterr().err.strip()
    assert ended.value.code == 2 and said in told and "Traceback" not in told


def test_beams_that_are_not_as_described_are_found_untold_and_keep_trust_from_being_whole():
    """The beams as described are 5 % stiffer than those of the test; four runs of the shipped rig, seed 0."""
    plan = load_rig_plan("pulse-rig")
    recorder = replace(plan.recorder, duration=4.0, settling=4.0)
    test = virtual_rig_test(plan.test, plan.drives[:4], recorder, 0)
    stiffer = replace(test.structure, stiffness=1.05 * test.structure.stiffness)
    found = discover_rig(replace(test, structure=stiffer), "paper", refine=False)
    assert found.misfit < 1.1 and found.trust.answer == "With reservations"
    assert found.trust.data.colour == "fair" and "agree with a changed one" in found.trust.data.sentence
    assert any("stiffness of lower beam -5" in line for line in found.warnings)
    true, (law,) = dict(zip(TERMS, INTER_PANEL.average, strict=True)), found.laws
    assert law.discovery.trust.data == found.trust.data
    for term in law.discovery.model.terms:
        # Numbers of the structure are known to tenths of a percent here, and c1 and k3 follow them several times.
        assert term.coefficient == pytest.approx(true[term.id], rel=0.05), term.id
