"""``sindyjoint init`` from folders that say little: one unit for a test, answers kept, loads that nobody measured."""

import json
import shlex
import tomllib

import numpy as np
import pytest
from scipy.io import savemat

from sindyjoint import init
from sindyjoint.errors import InputError
from sindyjoint.files import load_campaign

RATE = 200.0
TIME = np.arange(0, 12, 1 / RATE)


def table(path, titles, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=titles, comments="", fmt="%.9g")


def swing(size, frequency=2.0):
    """Moment and angle of a spring with friction under a sine, in some unit; seed 5, 0.1 % noise."""
    noise = np.random.default_rng(5).standard_normal((2, TIME.size))
    phase = 2 * np.pi * frequency * TIME
    moment = 4 * np.sin(phase) + np.sign(np.cos(phase)) + 4e-3 * noise[0]
    return moment, size * (np.sin(phase) + 1e-3 * noise[1])


def manifest(folder):
    return tomllib.loads((folder / "campaign.toml").read_text(encoding="utf-8"))


def test_a_unit_that_no_file_states_is_one_for_all_files(sindyjoint, tmp_path):
    # By its own size each file would be another unit: 0.02 is a usual angle in rad, 9 in degrees.
    for name, size in (("a", 0.02), ("b", 0.3), ("c", 9.0)):
        table(tmp_path / f"{name}.csv", "time,torque_Nm,q", TIME, *swing(size))
    done = sindyjoint("init", tmp_path, "--yes")
    assert done.status == 0
    written = manifest(tmp_path)
    assert written["channels"]["angle"]["unit"] == "deg"
    assert not any("channels" in run for run in written["run"])
    assert "guessed: angle.unit = deg for all 3 runs" in done.stdout
    # Until it is settled no verb trusts what it finds.
    assert load_campaign(tmp_path).guessed == ("angle.unit = deg",)
    told = json.loads(sindyjoint("check", tmp_path, "--json").stdout)
    (found,) = [f for f in told["findings"] if f["id"] == "unsettled_guess"]
    assert found["severity"] == "biases" and "angle.unit = deg" in found["extent"]
    assert found["remedy"].endswith(f"sindyjoint init {tmp_path} --force --set angle.unit=deg")
    text = (tmp_path / "campaign.toml").read_text(encoding="utf-8")
    (tmp_path / "campaign.toml").write_text(text.replace('guessed = ["angle.unit = deg"]\n', ""))
    told = json.loads(sindyjoint("check", tmp_path, "--json").stdout)
    assert "unsettled_guess" not in {f["id"] for f in told["findings"]}
    # Without --yes it is asked, once, with what the files hold.
    (tmp_path / "campaign.toml").unlink()
    asked = sindyjoint("init", tmp_path)
    assert asked.status == 2
    assert asked.stderr.count("angle.unit:") == 1 and "column q, up to 9.0" in asked.stderr


def test_a_unit_that_one_file_states_is_that_of_its_column_in_all(sindyjoint, tmp_path):
    head = "time,torque,q\n"
    for name, units, size in (("a", "s,N*m,mrad\n", 2.0), ("b", "", 9.0)):
        table(tmp_path / f"{name}.csv", (head + units).strip(), TIME, *swing(size))
    assert sindyjoint("init", tmp_path).status == 0
    assert manifest(tmp_path)["channels"]["angle"] == {"column": "q", "unit": "mrad"}


def test_a_table_says_what_each_column_is_and_why_and_ends_with_the_check_and_a_picture(sindyjoint, tmp_path):
    table(tmp_path / "a.csv", "time_s,torque_Nm,q,pulses_N", TIME, *swing(9.0), np.arange(TIME.size))
    done = sindyjoint("init", tmp_path, "--yes")
    rows = [line.split() for line in done.stdout.splitlines()]
    assert ["file", "column", "quantity", "unit", "why"] in rows
    assert any(row[:4] == ["a.csv", "q", "angle", "deg"] for row in rows)
    # A number of pulses is no force in newtons, whatever its name ends in.
    assert any(row[1:4] == ["pulses_N", "not", "used"] for row in rows)
    assert "the data are " in done.stdout
    assert (tmp_path / "runs.svg").read_bytes().startswith(b"<?xml")
    record = json.loads(sindyjoint("init", tmp_path, "--yes", "--force", "--json").stdout)
    assert record["check"]["verdict"] in ("sound", "doubtful")
    assert {"angle", "moment", "time", "not used"} == {column["quantity"] for column in record["columns"]}


def test_a_counter_is_not_taken_for_the_force_of_a_drive(sindyjoint, tmp_path, public_data):
    from scipy.io import loadmat

    held = {k: v for k, v in loadmat(public_data("emps") / "DATA_EMPS.mat").items() if not k.startswith("_")}
    savemat(tmp_path / "DATA.mat", held | {"pulses_N": np.arange(held["t"].size)[:, None] // 2000})
    asked = sindyjoint("init", tmp_path)
    assert asked.status == 2 and "(qg, qm, vir)" in asked.stderr
    # One round trip: who answers what the force is has said that the joint slides.
    answers = (
        "force=vir",
        "force.unit=V",
        "force.gain=35.15065188 N/V",
        "displacement=qm",
        "displacement.unit=m",
    )
    settings = [word for answer in answers for word in ("--set", answer)]
    assert sindyjoint("init", tmp_path, *settings).status == 0
    assert manifest(tmp_path)["channels"]["force"]["column"] == "vir"


def test_what_the_message_says_to_type_is_enough(sindyjoint, tmp_path):
    folder = tmp_path / "a folder"
    folder.mkdir()
    np.savetxt(folder / "a.txt", np.column_stack([TIME, *swing(9.0)]))
    asked = sindyjoint("init", folder, "--set", "motion=rotation")
    assert asked.status == 2
    words = shlex.split(asked.stderr[asked.stderr.index("sindyjoint init") :])
    assert "motion=rotation" in words
    assert sindyjoint(*words[1:]).status == 0


@pytest.mark.parametrize(
    ("answer", "complaint"),
    [
        ("moment.unit=mm", "moment.unit: unit 'mm' is not a moment"),
        ("angle.unit=N", "angle.unit: unit 'N' is not an angle"),
        ("inertia=3 kg", "inertia"),
        ("force.unit=N", "'force' is answered, and the joint is one in rotation"),
    ],
)
def test_an_answer_of_another_quantity_is_refused(sindyjoint, tmp_path, answer, complaint):
    table(tmp_path / "a.csv", "time,torque,q", TIME, *swing(9.0))
    refused = sindyjoint("init", tmp_path, "--yes", "--set", "motion=rotation", "--set", answer)
    assert refused.status == 2 and complaint in refused.stderr
    assert not (tmp_path / "campaign.toml").exists()


def test_a_wrong_answer_is_asked_for_again_and_the_others_stay(tmp_path):
    table(tmp_path / "a.csv", "time,torque,q", TIME, *swing(9.0))
    answers = {"moment.unit": ["N*m"], "angle.unit": ["N", "furlong", "mrad"]}
    complaints = []

    def ask(question):
        complaints.append((question.key, question.complaint))
        return answers[question.key].pop(0)

    made = init(tmp_path, ask=ask)
    assert [key for key, _ in complaints] == ["moment.unit", "angle.unit", "angle.unit", "angle.unit"]
    assert [bool(complaint) for _, complaint in complaints] == [False, False, True, True]
    assert "mrad" in made.draft.channels["angle"]
    # A program that answers the same again is told, not asked for ever.
    made.manifest.unlink()
    with pytest.raises(InputError, match="is not an angle"):
        init(tmp_path, ask=lambda question: "N*m" if question.key == "moment.unit" else "N")


def test_what_a_manifest_says_and_no_file_does_outlasts_another_init(sindyjoint, tmp_path):
    for name in "ab":
        table(tmp_path / f"{name}.csv", "time,torque,q,ch4", TIME, *swing(9.0), TIME)
    answers = {
        "inertia": "0.02 kg*m^2",
        "moment.unit": "V",
        "moment.gain": "5 N*m/V",
        "angle.unit": "mrad",
        "validate": "b",
    }
    settings = [word for key, value in answers.items() for word in ("--set", f"{key}={value}")]
    assert sindyjoint("init", tmp_path, *settings).status == 0
    before = manifest(tmp_path)
    again = sindyjoint("init", tmp_path, "--force")
    assert again.status == 0 and manifest(tmp_path) == before
    assert "kept: angle.unit = mrad; --set angle.unit=... changes it" in again.stdout
    assert json.loads(sindyjoint("init", tmp_path, "--force", "--json").stdout)["kept"] == answers
    # What is set anew is; what hung on it is asked, not kept.
    changed = sindyjoint("init", tmp_path, "--force", "--set", "moment.unit=N*m", "--set", "validate=a")
    assert changed.status == 0 and manifest(tmp_path)["channels"]["moment"] == {
        "column": "torque",
        "unit": "N*m",
    }
    assert [run.use for run in load_campaign(tmp_path).runs] == ["validate", "identify"]
    asked = sindyjoint("init", tmp_path, "--force", "--set", "angle=ch4")
    assert asked.status == 2 and "--set angle.unit=deg" in asked.stderr and " --force" in asked.stderr
    # A unit is that of its column, not of one that another file calls otherwise.
    table(tmp_path / "c.csv", "t_s,M_Nm,phi_deg", TIME, *swing(0.1))
    assert sindyjoint("init", tmp_path, "--force").status == 0
    assert [run["channels"]["angle"]["unit"] for run in manifest(tmp_path)["run"]] == ["mrad", "mrad", "deg"]


def test_a_guess_is_no_answer_when_a_manifest_is_drafted_anew(sindyjoint, tmp_path):
    table(tmp_path / "a.csv", "time_s,torque_Nm,q", TIME, *swing(9.0))
    assert sindyjoint("init", tmp_path, "--yes").status == 0
    assert "kept" not in sindyjoint("init", tmp_path, "--yes", "--force").stdout
    assert load_campaign(tmp_path).guessed == ("angle.unit = deg",)
    # Where the files do not fit an answer it is named, with the way out.
    text = (
        (tmp_path / "campaign.toml")
        .read_text()
        .replace('column = "q"', 'column = "phi"')
        .replace("guessed", "# ")
    )
    (tmp_path / "campaign.toml").write_text(text)
    refused = sindyjoint("init", tmp_path, "--force")
    assert (
        refused.status == 2
        and "campaign.toml says angle = 'phi', angle.unit = 'deg': change it with --set" in refused.stderr
    )
    assert sindyjoint("init", tmp_path, "--force", "--set", "angle=q", "--set", "angle.unit=deg").status == 0


def test_a_free_decay_without_a_load_is_one_under_no_load(sindyjoint, tmp_path):
    angle = 0.3 * np.exp(-TIME / 4) * np.cos(8 * TIME)
    table(tmp_path / "swing.csv", "time_s,angle_rad", TIME, angle)
    asked = sindyjoint("init", tmp_path)
    assert asked.status == 2 and "'moment=0 N*m'" in asked.stderr
    assert sindyjoint("init", tmp_path, "--set", "moment=0 N*m").status == 0
    written = manifest(tmp_path)
    assert written["channels"]["moment"] == {"constant": "0 N*m"}
    # Without a load the equation is known up to a factor: that of the inertia.
    assert written["joint"]["inertia"] == "1 kg*m^2"
    (tmp_path / "campaign.toml").unlink()
    done = sindyjoint("init", tmp_path, "--yes")
    assert "free decay" in done.stdout and "guessed: moment = 0 N*m" in done.stdout
    assert sindyjoint("check", tmp_path).status == 0


def test_of_a_load_that_is_zero_in_a_free_decay_driven_runs_keep_their_column(sindyjoint, tmp_path):
    table(tmp_path / "swing.csv", "time_s,angle_rad", TIME, 0.3 * np.exp(-TIME / 4) * np.cos(8 * TIME))
    table(tmp_path / "driven.csv", "time_s,torque_Nm,angle_rad", TIME, *swing(0.3))
    done = sindyjoint("init", tmp_path, "--set", "moment=0 N*m")
    assert done.status == 0 and "left out" not in done.stdout
    driven, free = load_campaign(tmp_path).runs
    assert np.ptp(driven.moment) > 0 and not free.moment.any()
    told = json.loads(sindyjoint("check", tmp_path, "--json").stdout)
    assert "frozen_channel" not in {f["id"] for f in told["findings"]}


def test_units_written_out_and_a_count_of_rows_beside_a_stated_rate(sindyjoint, tmp_path):
    head = "Sample frequency [Hz]: 200\n\nSample,Torque [Newton Meter],Encoder [Degrees]"
    table(tmp_path / "a.csv", head, np.arange(TIME.size), *swing(9.0))
    assert sindyjoint("init", tmp_path).status == 0
    (run,) = load_campaign(tmp_path).runs
    assert run.sample_rate == RATE and np.degrees(run.angle.max()) == pytest.approx(9.0, rel=0.01)


def test_a_driven_motion_without_a_load_says_how_to_declare_none(sindyjoint, tmp_path):
    table(tmp_path / "a.csv", "time_s,angle_rad", TIME, swing(0.1)[1])
    refused = sindyjoint("init", tmp_path, "--yes")
    assert refused.status == 2 and "set moment='0 N*m'" in refused.stderr


@pytest.mark.parametrize(("name", "value"), [("fs", RATE), ("Ts", 1 / RATE), ("sampling_rate", RATE)])
def test_a_single_number_in_a_matlab_file_is_its_rate(sindyjoint, tmp_path, name, value):
    moment, angle = swing(9.0)
    savemat(tmp_path / "a.mat", {"torque_Nm": moment, "angle_mrad": angle, name: value, "gain": 7.0})
    done = sindyjoint("init", tmp_path)
    assert done.status == 0
    assert manifest(tmp_path)["channels"]["rate"] == "200 Hz"
    assert f"the file's {name}" in done.stdout
    assert "inputs=" not in done.stdout


def test_each_file_keeps_the_rate_that_it_tells_and_others_have_theirs_asked(sindyjoint, tmp_path):
    for name, rate in (("a", 200), ("b", 200), ("c", 100)):
        values = [each[:: 200 // rate] for each in swing(9.0)]
        head = f"Sampling rate: {rate} Hz\n\n" if name == "a" else ""
        table(tmp_path / f"{name}.csv", head + "torque_Nm,angle_mrad", *values)
    asked = sindyjoint("init", tmp_path)
    assert asked.status == 2 and "how fast was b.csv sampled" in asked.stderr
    assert "One rate is that of c.csv, too, or one for each: 'b.csv: 1 kHz, c.csv: ...'" in asked.stderr
    # One rate is that of the files that tell none.
    assert sindyjoint("init", tmp_path, "--set", "rate=100 Hz").status == 0
    assert [run.sample_rate for run in load_campaign(tmp_path).runs] == [200, 100, 100]
    done = sindyjoint("init", tmp_path, "--force", "--set", "rate=b.csv: 200 Hz, c.csv: 100 Hz")
    assert done.status == 0 and "kept" not in done.stdout
    assert [(run.sample_rate, run.frequency) for run in load_campaign(tmp_path).runs] == [
        (200, 2),
        (200, 2),
        (100, 2),
    ]
    again = sindyjoint("init", tmp_path, "--force")
    assert again.status == 0 and "kept: rate = a.csv: 200 Hz, b.csv: 200 Hz, c.csv: 100 Hz" in again.stdout
    assert [run.sample_rate for run in load_campaign(tmp_path).runs] == [200, 200, 100]
    refused = sindyjoint("init", tmp_path, "--force", "--set", "rate=b.csv: 200 Hz")
    assert refused.status == 2 and "expected FILE: RATE for each of b.csv, c.csv" in refused.stderr


@pytest.mark.parametrize("written", ["row", "column", "letters", "cells"])
def test_names_and_units_in_cells_beside_a_matrix_are_those_of_its_columns(sindyjoint, tmp_path, written):
    names, units, columns = (np.empty((3, 1), dtype=object) for _ in range(3))
    names[:, 0], units[:, 0], columns[:, 0] = (
        ["time", "torque", "phi"],
        ["s", "N*m", "mrad"],
        [TIME, *swing(9.0)],
    )
    stored = {"data": np.column_stack(columns[:, 0]), "channel_names": names, "units": units}
    if written == "row":
        stored |= {"channel_names": names.T, "units": units.T}
    if written == "letters":
        stored["channel_names"] = np.array(["time  ", "torque", "phi   "])
    if written == "cells":
        stored["data"] = columns
    savemat(tmp_path / "a.mat", stored)
    assert sindyjoint("init", tmp_path).status == 0
    assert manifest(tmp_path)["channels"]["angle"] == {"column": "data.phi", "unit": "mrad"}
    np.testing.assert_allclose(load_campaign(tmp_path).runs[0].moment, columns[1, 0])


@pytest.mark.parametrize(
    "head",
    [
        "time,torque,phi\ns,N*m,mrad\nCH1,CH2,CH3",
        "Bench,Bench,Bench\ntime,torque,phi\ns,N*m,mrad",
        "Channel 1,Channel 2,Channel 3\ntime,torque,phi\nraw,raw,filtered\ns,N*m,mrad",
    ],
)
def test_of_three_lines_of_headings_those_of_names_and_units_are_read(sindyjoint, tmp_path, head):
    table(tmp_path / "a.csv", head, TIME, *swing(9.0))
    assert sindyjoint("init", tmp_path).status == 0
    channels = manifest(tmp_path)["channels"]
    assert [channels[key]["column"] for key in ("time", "moment", "angle")] == ["time", "torque", "phi"]
    assert channels["angle"]["unit"] == "mrad"


def test_points_between_thousands_are_read_beside_decimal_commas_and_refused_alone(sindyjoint, tmp_path):
    moment, angle = swing(9.0)
    written = [f"{1e3 * each:,.3f}" for each in angle]
    german = [each.translate(str.maketrans(",.", ".,")) for each in written]
    rows = [f"{t:.3f};{m:.4f}".replace(".", ",") for t, m in zip(TIME, moment, strict=True)]
    head = "time_s;torque_Nm;angle_urad"
    lines = [f"{row};{a}" for row, a in zip(rows, german, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join([head, *lines, ""]))
    assert sindyjoint("init", tmp_path).status == 0
    np.testing.assert_allclose(load_campaign(tmp_path).runs[0].angle, 1e-3 * angle, atol=1e-9)
    whole = [f"{1e6 * each:,.0f}".replace(",", ".") for each in angle]
    lines = [f"{t:.3f};{m:.4f};{a}" for t, m, a in zip(TIME, moment, whole, strict=True)]
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "a.csv").write_text("\n".join([head, *lines, ""]))
    refused = sindyjoint("init", tmp_path / "b")
    assert refused.status == 2 and "column 'angle_urad' holds '" in refused.stderr


def test_sweeps_and_repeated_runs_are_told(sindyjoint, tmp_path):
    sweep = np.sin(2 * np.pi * (0.5 * TIME + 0.15 * TIME**2))
    table(tmp_path / "up.csv", "time_s,torque_Nm,angle_mrad", TIME, 4 * sweep, 9 * sweep)
    for number in (1, 2):
        table(tmp_path / f"2Hz-low-{number}.csv", "time_s,torque_Nm,angle_mrad", TIME, *swing(9.0))
    lines = sindyjoint("init", tmp_path).stdout.splitlines()
    (told,) = [line for line in lines if line.startswith("  up.csv")]
    assert "sweep" in told
    assert sum("2 Hz, level low, one of 2 that repeat" in line for line in lines) == 2


def joint(angle, rate, acceleration, inertia):
    """The paper's kind of law, known by its formula."""
    return 60 * angle + 0.4 * rate + 0.3 * np.sign(rate) + inertia * acceleration


def campaign(folder, runs, inertia='inertia = "0 kg*m^2"', channel=""):
    """Write runs of (name, frequency, moment, angle, what its channels are) with a manifest."""
    lines = ['[joint]', 'name = "j"', inertia, "[channels]", f'rate = "{RATE:g} Hz"',
             'moment = { column = "M", unit = "N*m" }', 'angle = { column = "q", unit = "rad" }']  # fmt: skip
    for name, frequency, moment, angle, own in runs:
        table(folder / f"{name}.csv", "M,q", moment, angle)
        lines += ["[[run]]", f'file = "{name}.csv"', f"frequency = {frequency}", *([own] if own else [])]
    (folder / "campaign.toml").write_text("\n".join(lines))
    return folder


def nine(inertia=0.0):
    """Nine runs of that joint, three levels at three frequencies; 0.5 % noise, seed 8."""
    rng = np.random.default_rng(8)
    for frequency in (1.0, 2.0, 4.0):
        for level in (0.02, 0.04, 0.08):
            turn = 2 * np.pi * frequency
            angle, rate = level * np.sin(turn * TIME), level * turn * np.cos(turn * TIME)
            moment = joint(angle, rate, -(turn**2) * angle, inertia)
            noisy = [x + 5e-3 * np.std(x) * rng.standard_normal(x.size) for x in (moment, angle)]
            yield f"{frequency:g}Hz-{level:g}".replace(".", "p"), frequency, *noisy


@pytest.mark.parametrize("count", [1, 4])
@pytest.mark.parametrize("channel", ["moment", "angle"])
@pytest.mark.parametrize("factor", [180 / np.pi, 1e-3, 9.80665, 1 / 4.4482216, 25.4])
def test_check_finds_the_runs_in_another_unit(sindyjoint, tmp_path, channel, factor, count):
    odd = [1, 3, 4, 8][:count]
    runs = list(nine())
    gains = [factor if i in odd else 1.0 for i in range(9)]
    scaled = [
        (name, f, m * (g if channel == "moment" else 1), a * (g if channel == "angle" else 1), "")
        for g, (name, f, m, a) in zip(gains, runs, strict=True)
    ]
    told = sindyjoint("check", campaign(tmp_path, scaled), "--json")
    assert told.status == 1
    # What a run of that size is beside, such as more than half a turn, is another finding.
    found = [f for f in json.loads(told.stdout)["findings"] if f["id"] in ("gain_differs", "run_differs")]
    assert {(f["id"], f["channel"], f["run"]) for f in found} == {
        ("gain_differs", channel, runs[i][0]) for i in odd
    }
    assert all(f"{factor:.4g} times" in f["extent"] for f in found)


def test_check_finds_reversed_runs_and_nothing_in_sound_ones(sindyjoint, tmp_path):
    runs = [(*run, "") for run in nine()]
    sound = json.loads(sindyjoint("check", campaign(tmp_path, runs), "--json").stdout)
    assert sound["verdict"] == "sound"
    odd = [0, 3, 5, 7]
    turned = [(n, f, -m if i in odd else m, a, own) for i, (n, f, m, a, own) in enumerate(runs)]
    told = json.loads(sindyjoint("check", campaign(tmp_path, turned), "--json").stdout)
    assert {(f["id"], f["run"]) for f in told["findings"] if f["severity"] == "stops"} == {
        ("reversed_sign", runs[i][0]) for i in odd
    }


def test_a_file_that_was_cut_off_at_the_end_of_a_line_is_told(sindyjoint, tmp_path):
    folder = campaign(tmp_path, [(*run, "") for run in nine()])
    (first, *_) = sorted(folder.glob("*.csv"))
    lines = first.read_text().splitlines(keepends=True)
    first.write_text("".join(lines[: len(lines) // 3]))
    told = json.loads(sindyjoint("check", folder, "--json").stdout)
    (found,) = [f for f in told["findings"] if f["id"] == "coverage"]
    assert found["run"] == first.stem and "8 of 9 runs 12 s" in found["extent"]


def test_check_names_a_column_that_is_declared_in_two_units(sindyjoint, tmp_path):
    own = '[run.channels]\nangle = { column = "q", unit = "mrad" }'
    runs = [(*run, own if i == 2 else "") for i, run in enumerate(nine())]
    told = json.loads(sindyjoint("check", campaign(tmp_path, runs), "--json").stdout)
    (finding,) = [f for f in told["findings"] if f["id"] == "unit_mismatch"]
    assert finding["run"] == runs[2][0]
    assert "'q' is declared in 'mrad' here and in 'rad' in 8 of 9 runs" in finding["extent"]


def test_a_negative_inertia_is_called_impossible_everywhere(sindyjoint, tmp_path):
    runs = [(*run, "") for run in nine(inertia=-0.02)]
    folder, results = campaign(tmp_path, runs, inertia=""), tmp_path / "results"
    done = sindyjoint("discover", folder, "--out", results)
    assert "negative, which is impossible" in done.stdout.replace("\n", " ")
    record = json.loads(sindyjoint("discover", folder, "--json").stdout)
    assert record["joint"]["inertia"] == pytest.approx(-0.02, rel=0.05)
    assert any("is negative" in line and "impossible" in line for line in record["warnings"])
    assert record["trust"]["answer"] == "poor"
    assert record["trust"]["determined"]["colour"] == "poor"
    page = (results / "report.html").read_text(encoding="utf-8")
    assert "negative, which is impossible" in page


def test_of_two_angles_that_differ_none_is_guessed_and_check_says_what_is_not_used(sindyjoint, tmp_path):
    moment, angle = swing(2.0)
    base = 0.1 * moment
    table(
        tmp_path / "a.csv",
        "time_s,torque_Nm,angle_upper_mrad,angle_lower_mrad",
        TIME,
        moment,
        angle + base,
        base,
    )
    asked = sindyjoint("init", tmp_path, "--yes")
    assert asked.status == 2 and "angle: which column is the angle" in asked.stderr
    both = "angle_upper_mrad - angle_lower_mrad"
    assert f"Of sensors on both sides of the joint it is '{both}'" in asked.stderr
    assert sindyjoint("init", tmp_path, "--set", f"angle={both}").status == 0
    written = (tmp_path / "campaign.toml").read_text()
    assert manifest(tmp_path)["channels"]["angle"]["minus"] == "angle_lower_mrad"
    told = json.loads(sindyjoint("check", tmp_path, "--json").stdout)
    assert "other_sensor" not in {f["id"] for f in told["findings"]}
    (tmp_path / "campaign.toml").write_text(written.replace('minus = "angle_lower_mrad", ', ""))
    told = json.loads(sindyjoint("check", tmp_path, "--json").stdout)
    (found,) = [f for f in told["findings"] if f["id"] == "other_sensor"]
    assert "minus = 'angle_lower_mrad'" in found["remedy"]
    # Trust is withheld until it is written what the other one is.
    assert told["verdict"] == "doubtful"
    (tmp_path / "campaign.toml").write_text(written.replace('"angle_lower_mrad", ', '"none", '))
    told = json.loads(sindyjoint("check", tmp_path, "--json").stdout)
    assert told["verdict"] == "sound"
    # So init writes it, where one of two was the answer.
    alone = sindyjoint("init", tmp_path, "--set", "angle=angle_upper_mrad", "--force")
    assert alone.status == 0 and manifest(tmp_path)["channels"]["angle"]["minus"] == "none"


@pytest.mark.parametrize(
    "title, other, found",
    [
        # Of a base that turns in proportion, no correlation tells.
        ("angle_lower_mrad", lambda angle, noise: 0.3 * angle, True),
        ("angle_lower_rad", lambda angle, noise: 0.3e-3 * angle, True),
        ("angle_lower_mrad", lambda angle, noise: 0.1 * noise, False),
        ("angle_2_mrad", lambda angle, noise: angle + 0.05 * noise, False),
        ("angle_coarse_deg", lambda angle, noise: np.degrees(np.round(angle, 1) / 1e3), False),
    ],
)
def test_a_second_sensor_counts_where_it_moves_otherwise_beyond_noise(
    sindyjoint, tmp_path, title, other, found
):
    moment, angle = swing(2.0)
    second = other(angle, np.random.default_rng(6).standard_normal(angle.size))
    table(tmp_path / "a.csv", f"time_s,torque_Nm,angle_mrad,{title}", TIME, moment, angle, second)
    (tmp_path / "campaign.toml").write_text(
        """[channels]
time = { column = "time_s", unit = "s" }
moment = { column = "torque_Nm", unit = "N*m" }
angle = { column = "angle_mrad", unit = "mrad" }
[[run]]
file = "a.csv"
frequency = 2.0
"""
    )
    told = json.loads(sindyjoint("check", tmp_path, "--json").stdout)
    assert ("other_sensor" in {f["id"] for f in told["findings"]}) == found
    assert (told["verdict"] == "doubtful") == found


def test_a_velocity_is_no_displacement(sindyjoint, tmp_path):
    force, velocity = swing(20.0)
    table(tmp_path / "a.csv", "t,F_kN,LDV_mm/s", TIME, force, velocity)
    done = sindyjoint("init", tmp_path, "--yes")
    assert done.status == 2 and not (tmp_path / "campaign.toml").exists()
    assert (
        "LDV_mm/s (velocity); a rate leaves the displacement open: add a column with its integral"
        in done.stderr
    )
    # Nor where somebody wrote it by hand.
    (tmp_path / "campaign.toml").write_text(
        """[joint]
motion = "translation"
[channels]
time = { column = "t", unit = "s" }
force = { column = "F_kN", unit = "kN" }
displacement = { column = "LDV_mm/s", unit = "mm" }
[[run]]
file = "a.csv"
"""
    )
    told = json.loads(sindyjoint("check", tmp_path, "--json").stdout)
    assert told["verdict"] == "unsound"
    (found,) = [f for f in told["findings"] if f["id"] == "unit_mismatch"]
    assert "the file states 'mm/s': that is no such quantity" in found["extent"]


def test_a_force_on_a_lever_is_a_moment_with_the_length_of_the_lever(sindyjoint, tmp_path):
    force, angle = swing(2.0)
    for name in "abcde":
        table(tmp_path / f"{name}.csv", "time_s,force_N,theta_mrad", TIME, force, angle)
    done = sindyjoint("init", tmp_path, "--yes")
    assert done.status == 2 and done.stderr.count("holds no column for the moment") == 1
    told = done.stderr[done.stderr.index("--set") :]
    assert sindyjoint("init", tmp_path, *shlex.split(told)).status == 0
    assert manifest(tmp_path)["channels"]["moment"] == {"column": "force_N", "unit": "N", "gain": "0.2 m"}


def test_channels_of_two_rates_are_joined_by_their_times_or_told_with_their_lengths(sindyjoint, tmp_path):
    h5py = pytest.importorskip("h5py")
    moment, angle = swing(2.0)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["Torque"], file["Angle"] = moment, angle[::4]
        file["Torque"].attrs["unit"], file["Angle"].attrs["unit"] = "Nm", "mrad"
    told = sindyjoint("init", tmp_path, "--yes").stderr
    said = "('Torque' has 2400 samples and the others 600: bring all to one rate, or give each its time)"
    assert f"no column for the moment {said}" in told
    # The same of two files with the channels of one run, and a time each.
    apart = tmp_path / "apart"
    apart.mkdir()
    table(apart / "a_torque.csv", "time_s,torque_Nm", TIME, moment)
    table(apart / "a_angle.csv", "time_s,angle_mrad", TIME[::4], angle[::4])
    assert sindyjoint("init", apart).status == 0
    (run,) = load_campaign(apart).runs
    assert run.sample_rate == RATE / 4
    np.testing.assert_allclose(run.angle, 1e-3 * angle[::4], rtol=1e-5)
    np.testing.assert_allclose(run.moment, moment[::4], rtol=1e-5)


def test_of_a_channel_with_blanks_in_every_second_row_the_others_are_used(sindyjoint, tmp_path):
    moment, angle = swing(2.0)
    rows = [
        f"{t:.4f},{m:.6g},{'' if i % 2 else f'{a:.6g}'}"
        for i, (t, m, a) in enumerate(zip(TIME, moment, angle, strict=True))
    ]
    (tmp_path / "a.csv").write_text("\n".join(["time_s,torque_Nm,angle_mrad", *rows]) + "\n")
    assert sindyjoint("init", tmp_path).status == 0
    read = load_campaign(tmp_path)
    assert read.runs[0].sample_rate == RATE / 2
    np.testing.assert_allclose(read.runs[0].angle, 1e-3 * angle[::2], rtol=1e-5)
    np.testing.assert_allclose(read.runs[0].moment, moment[::2], rtol=1e-5)
    (said,) = read.notes
    assert said.startswith(
        "a.csv: of 2400 samples no number in column angle_mrad in 1200; one row of 2 is used"
    )
    # Wherever the data are judged, a person reads it.
    assert said in json.loads(sindyjoint("check", tmp_path, "--json").stdout)["notes"]
    checked = sindyjoint("check", tmp_path, "--out", tmp_path / "checked")
    assert said[:60] in checked.stdout.replace("\n", " ")
    assert said in (tmp_path / "checked" / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("unit", ["deg", "counts"])
def test_an_angle_that_begins_anew_after_a_turn_is_unwound(sindyjoint, tmp_path, unit):
    one = {"deg": np.pi / 180, "counts": 1e-6}[unit]
    for name, size in (("a", 3e-3), ("b", 9e-3)):
        moment, angle = swing(size)
        # One run begins on this side of zero, the other on that.
        values = (angle if name == "a" else np.roll(angle, TIME.size // 2)) / one + (
            0.01 if name == "a" else -0.01
        )
        values = values % 360 if unit == "deg" else np.round(values) % 65536
        table(tmp_path / f"{name}.csv", f"time_s,torque_Nm,angle_{unit}", TIME, moment, values)
    gain = ["--set", "angle.gain=1e-6 rad/count"] if unit == "counts" else []
    done = sindyjoint("init", tmp_path, *gain)
    assert done.status == 0
    assert [run["frequency"] for run in manifest(tmp_path)["run"]] == [2.0, 2.0]
    campaign = load_campaign(tmp_path)
    assert [float(np.ptp(run.angle)) for run in campaign.runs] == pytest.approx([6e-3, 18e-3], rel=0.01)
    assert max(float(np.abs(run.angle).max()) for run in campaign.runs) < 0.01
    assert "the angle leaps by whole turns: it was unwound" in campaign.notes


def test_a_spike_of_a_sensor_is_no_turn(sindyjoint, tmp_path):
    moment, angle = swing(2.0)
    angle[700] = 500.0
    table(tmp_path / "a.csv", "time_s,torque_Nm,angle_deg", TIME, moment, angle)
    assert sindyjoint("init", tmp_path).status == 0
    assert np.degrees(load_campaign(tmp_path).runs[0].angle.max()) == pytest.approx(500.0)


def test_what_has_one_value_in_each_run_is_offered_as_an_input(sindyjoint, tmp_path):
    moment, angle = swing(2.0)
    for name, warm, load in (("a", 20.0, 100.0), ("b", 60.0, 250.0)):
        rest = [np.full(TIME.size, load), warm + 0.05 * np.cos(TIME)]
        table(
            tmp_path / f"{name}.csv",
            "time_s,torque_Nm,q_mrad,preload_N,temp [°C]",
            TIME,
            moment,
            angle,
            *rest,
        )
    offered = sindyjoint("init", tmp_path).stdout
    assert "one value in each run, 100 to 250; lets the law depend on it: --set inputs=preload_N" in offered
    assert sindyjoint("init", tmp_path, "--force", "--set", "inputs=preload_N, temp [°C]").status == 0
    assert manifest(tmp_path)["inputs"] == {
        "preload_N": {"column": "preload_N", "unit": "N"},
        "temp": {"column": "temp [°C]", "unit": "degC"},
    }
    read = load_campaign(tmp_path)
    assert [run.inputs["preload_N"][0] for run in read.runs] == [100.0, 250.0]
    assert read.inputs[1].unit == "K" and read.runs[1].inputs["temp"][0] == pytest.approx(333.2)
    refused = sindyjoint("init", tmp_path, "--force", "--set", "inputs=preload")
    assert refused.status == 2 and "did you mean 'preload_N'" in refused.stderr


def test_a_single_number_beside_the_columns_is_an_input_of_its_run(sindyjoint, tmp_path):
    moment, angle = swing(2.0)
    for name, gap in (("a", 0.1), ("b", 0.3)):
        held = {"time_s": TIME, "torque_Nm": moment, "angle_mrad": angle, "gap_mm": gap}
        savemat(tmp_path / f"{name}.mat", held)
    assert "--set inputs=gap_mm" in sindyjoint("init", tmp_path).stdout
    assert sindyjoint("init", tmp_path, "--force", "--set", "inputs=gap_mm").status == 0
    np.testing.assert_allclose(
        [run.inputs["gap_mm"][0] for run in load_campaign(tmp_path).runs], [1e-4, 3e-4]
    )
