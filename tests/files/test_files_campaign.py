"""From files to SI: the numbers, the bad data, the raw gauges, the declared skew."""

import gzip
import hashlib
import re

import numpy as np
import pytest

from sindyjoint.errors import InputError, SindyJointError

HEADER = 1  # lines above the data in run.csv


def test_units_become_si(bench):
    campaign = bench.load()
    run = campaign.runs[0]
    np.testing.assert_array_equal(run.moment, bench.columns["m"])
    np.testing.assert_allclose(run.angle, bench.columns["a"] * 1e-3, rtol=1e-15)
    assert run.sample_rate == 200.0
    assert (run.name, run.frequency, run.level, run.use) == ("run", 4.0, "low", "identify")
    assert campaign.joint.inertia == 0.02
    assert not campaign.simulated


def test_source_is_the_hash_of_the_file(bench):
    source = bench.load().runs[0].source
    assert source.path == "run.csv"
    assert source.sha256 == hashlib.sha256((bench.folder / "run.csv").read_bytes()).hexdigest()


def test_gain_and_offset(bench):
    bench.replace('"m", unit = "N*m"', '"m", unit = "V", gain = "3 N*m/mV", offset = "-2 N*m"')
    np.testing.assert_allclose(bench.load().runs[0].moment, bench.columns["m"] * 3000 - 2, rtol=1e-14)


@pytest.mark.parametrize(
    "unit, noise, found",
    [
        ('unit = "N*m"', "0.02 N*m", 0.02),
        ('unit = "N*m"', "20 mN*m", 0.02),
        ('unit = "V", gain = "-3 N*m/mV"', "2 mV", 6.0),
        ('unit = "V", gain = "3 N*m/mV"', "0.5 N*m", 0.5),
    ],
)
def test_declared_noise(bench, unit, noise, found):
    bench.replace('"m", unit = "N*m"', f'"m", {unit}, noise = "{noise}"')
    noise = bench.load().runs[0].noise
    assert noise.moment == pytest.approx(found)
    assert noise.angle is None


@pytest.mark.parametrize("noise", ["0.02 rad", "0.02", "-1 N*m", "0 N*m"])
def test_declared_noise_that_is_none(bench, noise):
    bench.replace('"m", unit = "N*m"', f'"m", unit = "N*m", noise = "{noise}"')
    with pytest.raises(SindyJointError, match="noise"):
        bench.load()


def test_declared_constant_moment(bench):
    bench.replace('column = "m", unit = "N*m"', 'constant = "2 N*m"')
    assert set(bench.load().runs[0].moment) == {2.0}


def test_rate_instead_of_time_column(bench):
    bench.replace('time = { column = "t", unit = "s" }', 'rate = "0.2 kHz"')
    assert bench.load().runs[0].sample_rate == 200.0


def test_measured_rate_of_angle(bench):
    bench.replace("[channels]", '[channels]\nrate_of_angle = { column = "a", unit = "deg/s" }')
    np.testing.assert_allclose(bench.load().runs[0].rate, np.deg2rad(bench.columns["a"]), rtol=1e-14)


def test_columns_by_position(bench):
    bench.replace('column = "m"', "column = 2").csv((bench.folder / "run.csv").read_text().split("\n", 1)[1])
    bench.manifest((bench.folder / "campaign.toml").read_text().replace('"t"', "1").replace('"a"', '"3"'))
    np.testing.assert_array_equal(bench.load().runs[0].moment, bench.columns["m"])


def test_one_run_overrides_a_channel(bench):
    bench.replace('level = "low"', 'name = "other"\n[run.channels]\nangle = { column = "m", unit = "deg" }')
    run = bench.load().runs[0]
    np.testing.assert_allclose(run.angle, np.deg2rad(bench.columns["m"]), rtol=1e-14)
    assert run.name == "other"


def test_translation(bench):
    bench.replace('inertia = "0.02 kg*m^2"', 'motion = "translation"\nmass = "2 lb"')
    text = (bench.folder / "campaign.toml").read_text()
    bench.manifest(
        text.replace(
            'moment = { column = "m", unit = "N*m" }', 'force = { column = "m", unit = "kip" }'
        ).replace('angle = { column = "a", unit = "mrad" }', 'displacement = { column = "a", unit = "inch" }')
    )
    campaign = bench.load()
    np.testing.assert_allclose(campaign.runs[0].moment, bench.columns["m"] * 4448.2216152605, rtol=1e-14)
    np.testing.assert_allclose(campaign.runs[0].angle, bench.columns["a"] * 0.0254, rtol=1e-14)
    assert campaign.joint.inertia == pytest.approx(2 * 0.45359237)


def test_raw_gauges_through_equations_1_to_3(bench):
    # Forwards by hand: ε = (2m − 2n)/4, M = β·2·EI·ε/h; θ = ((a + b)/2 − z)/L.
    m, a = bench.columns["m"], bench.columns["a"]
    columns = {
        "t": bench.columns["t"],
        "e1": m,
        "e2": m + 1,
        "e3": -m,
        "e4": 1 - m,
        "d1": a,
        "d2": 3 * a,
        "d3": a / 2,
    }
    bench.table(columns).manifest(
        """
        [channels]
        time = { column = "t", unit = "s" }
        [rig]
        strain = ["e1", "e2", "e3", "e4"]
        strain_unit = "um/m"
        displacement = ["d1", "d2", "d3"]
        displacement_unit = "mm"
        bending_stiffness = "2333 N*m^2"
        section_height = "20 mm"
        strain_position_factor = 1.02
        joint_length = "60 mm"
        [[run]]
        file = "run.csv"
        """
    )
    run = bench.load().runs[0]
    np.testing.assert_allclose(run.moment, 1.02 * 2 * 2333 * m * 1e-6 / 0.02, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(run.angle, 1.5e-3 * a / 0.06, rtol=1e-12)


# What a bad file says; the first sample of the data stands in line 2.
BAD_LINES = [
    (9, "0.035,abc,0.1", "line 9: column 'm' holds 'abc'; expected a number"),
    (9, "0.035,1_000,0.1", "line 9: column 'm' holds '1_000'; expected a number"),
    (9, "0.035,'0.1,0.1", """line 9: column 'm' holds "'0.1"; expected a number"""),
    (9, "0.035,0.1", "line 9 has 2 fields and line 1 has 3; expected equal numbers"),
    (9, "0.035,0.1,0.2,0.3", "line 9 has 4 fields and line 1 has 3"),
    (9, "0.029,0.1,0.2", "column 't': time runs backwards in line 9 (0.029 s after 0.03 s)"),
    (9, "0.03,0.1,0.2", "column 't': duplicate time stamp in line 9 (0.03 s after 0.03 s)"),
    (9, "0.0353,0.1,0.2", "sampling is irregular beyond 1 %, most in line 9"),
    (1, "t,m,m,a", "line 2 has 3 fields and line 1 has 4"),
    (1, "t,a,a", "column 'm' is missing"),
    (1, "t,m,angle", "column 'a' is missing; columns there: 't', 'm', 'angle'"),
    (1, "t,M,a", "column 'm' is missing"),
]


@pytest.mark.parametrize(("number", "text", "message"), BAD_LINES, ids=[row[1] for row in BAD_LINES])
def test_bad_line_is_named(bench, number, text, message):
    assert message in bench.line(number, text).refusal()


def test_nearest_column_is_offered(bench):
    bench.replace('column = "a"', 'column = "angel"').line(1, "t,m,angle")
    assert (
        "column 'angel' is missing; did you mean 'angle'? columns there: 't', 'm', 'angle'" in bench.refusal()
    )


def test_duplicate_column(bench):
    bench.line(1, "t,m,m")
    bench.manifest((bench.folder / "campaign.toml").read_text().replace('"a"', '"m"'))
    assert "column 'm' is there 2 times; give each column another name" in bench.refusal()


@pytest.mark.parametrize("text", [",0.1", "0.1,", "nan,0.1", "NA,0.1", "0.1,inf", "0.1,-1e999"])
def test_a_sample_without_a_number_is_left_out(bench, text):
    run = bench.line(9, f"0.035,{text}").load().runs[0]
    assert run.n_samples == 400 and np.flatnonzero(~run.valid).tolist() == [7]


def test_a_sensor_that_drops_out_for_a_while_costs_that_while(bench):
    values = bench.columns["m"].copy()
    values[130:170] = np.nan
    # The other periods of a steady run show what is missing.
    run = bench.column("m", values).load().runs[0]
    assert np.flatnonzero(~run.valid).tolist() == list(range(130, 170))
    # Of any other run the longest part without a gap remains, and it is said.
    bench.replace("frequency = 4.0", "")
    loaded = bench.column("m", values).load()
    assert loaded.runs[0].valid.all()
    np.testing.assert_array_equal(loaded.runs[0].moment, values[170:])
    said = "run.csv: of 400 samples no number in column m in 40; used from 0.85 s to 2 s: the rest counts for nothing"
    assert loaded.notes == (f"{said}; look at its cable",)


def test_a_sensor_that_is_silent_at_an_end_or_most_of_the_time(bench):
    values = bench.columns["m"].copy()
    values[:30] = values[390:] = np.nan
    run = bench.column("m", values).load().runs[0]
    np.testing.assert_array_equal(run.moment, values[30:390])
    values[:230] = np.nan
    assert "column 'm' holds nan in line 2 and 239 more" in bench.column("m", values).refusal()


def test_two_sensors_of_two_bodies_give_the_angle_between_them(bench):
    bench.replace('column = "a",', 'column = "a", minus = "b",')
    other = 0.3 * np.cos(40 * bench.columns["t"])
    run = bench.table(bench.columns | {"b": other}).load().runs[0]
    np.testing.assert_allclose(run.angle, 1e-3 * (bench.columns["a"] - other), rtol=1e-12)


def test_a_packed_file_is_read_and_one_that_ends_early_is_said_to_be_cut(bench):
    bench.replace("run.csv", "run.csv.gz")
    packed = gzip.compress((bench.folder / "run.csv").read_bytes())
    run = bench.csv(packed, "run.csv.gz").load().runs[0]
    np.testing.assert_array_equal(run.moment, bench.columns["m"])
    with pytest.raises(InputError, match="run.csv.gz: ends early: it was cut off"):
        bench.csv(packed[:-900], "run.csv.gz").load()
    with pytest.raises(InputError, match="run.csv.gz: cannot be read as gzip"):
        bench.csv(b"no gzip", "run.csv.gz").load()


def test_thousands_are_told_from_decimals(bench):
    assert bench.line(9, '0.035,"1,004.5",0.1').load().runs[0].moment[7] == 1004.5
    assert """column 'm' holds '1,004'; expected a number""" in bench.line(9, '0.035,"1,004",0.1').refusal()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is empty"),
        (b"\n  \n", "is empty; expected a table with a header and rows"),
        (b"# only\n# comments\n", "holds comment lines only"),
        (b"t,m,a\n", "has a header (t, m, a) and no rows of data"),
        (bytes(range(256)) * 20, "is not a text table (byte 0 at position 0)"),
        (b"\x89PNG\r\n\x1a\n" + b"\x07" * 50, "is not a text table"),
        (b"PK\x03\x04" + b"abc" * 50, "is not a text table"),
        (b"t,m,a\n" + b"0.0,1,2\n0.1,2,1\n" + b"\x00" * 100, "is not a text table (byte 0"),
    ],
)
def test_rubbish_named_csv(bench, data, message):
    assert message in bench.csv(data).refusal()


@pytest.mark.parametrize("seed", range(20))
def test_random_bytes_named_csv_are_refused(bench, seed):
    # Seeds 0–19: whatever the bytes happen to be, the answer is one line about this file.
    data = np.random.default_rng(seed).integers(0, 256, size=2000, dtype=np.uint8).tobytes()
    bench.csv(data).refusal()


def test_too_few_samples(bench):
    lines = (bench.folder / "run.csv").read_text().split("\n")
    assert "20 samples; expected at least 32" in bench.csv("\n".join(lines[:21])).refusal()


def test_sampling_too_slow(bench):
    bench.replace("frequency = 4.0", "frequency = 40")
    assert "sampling at 200 Hz is too slow for 40 Hz excitation; expected at least 400 Hz" in bench.refusal()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("m", "moment is constant (3 N*m); a dead channel? declare it as constant if it is meant"),
        ("a", "angle is constant (0.003 rad); a dead channel? expected a moving joint"),
    ],
)
def test_constant_channel(bench, name, message):
    assert message in bench.column(name, np.full(bench.columns["t"].size, 3.0)).refusal()


def test_frequency_absent(bench):
    bench.replace("frequency = 4.0", "frequency = 7")
    assert (
        "the declared frequency 7 Hz is absent from the data; the largest line of the angle is at 4 Hz; "
        "correct frequency, or leave it out for an aperiodic run"
    ) in bench.refusal()


def test_moment_and_angle_of_different_length(bench):
    np.savez(bench.folder / "run.csv.npz", t=np.arange(100) / 200.0, m=np.ones(99), a=np.ones(100))
    (bench.folder / "run.csv.npz").rename(bench.folder / "run.npz")
    bench.replace("run.csv", "run.npz")
    with pytest.raises(
        SindyJointError, match="run.npz: time has 100 samples, moment has 99 samples, angle has 100"
    ):
        bench.load()


def test_written_by_other_hands(bench):
    # Units row, µ in old code page, decimal commas, semicolons, Windows line ends, a comment amid the data.
    rows = [
        f"{t:.3f};{m:.6f};{a:.6f}".replace(".", ",") for t, m, a in zip(*bench.columns.values(), strict=True)
    ]
    text = "\r\n".join(["# Prüfstand 4", '"t";"m";"a"', "s;N*m;µrad", *rows[:9], "# pause", *rows[9:], ""])
    bench.csv(text.encode("latin-1"))
    np.testing.assert_allclose(bench.load().runs[0].moment, bench.columns["m"], atol=1e-6)


@pytest.mark.parametrize(
    "text",
    ["# t m a\n{rows}", "% t m a\n\n{rows}", "t  m   a\n{rows}", "\ufefft m a\n{rows}"],
    ids=["savetxt", "percent", "blanks", "byte order mark"],
)
def test_blank_separated_tables(bench, text):
    rows = "\n".join(
        f" {t!r}   {m!r} {a!r}" for t, m, a in zip(*(c.tolist() for c in bench.columns.values()), strict=True)
    )
    bench.csv(text.format(rows=rows))
    np.testing.assert_array_equal(bench.load().runs[0].moment, bench.columns["m"])


def test_text_in_a_column_that_nobody_asks_for(bench):
    lines = (bench.folder / "run.csv").read_text().strip().split("\n")
    bench.csv("\n".join([lines[0] + ",remark,", *(line + ",ok," for line in lines[1:])]))
    np.testing.assert_array_equal(bench.load().runs[0].moment, bench.columns["m"])


def test_a_file_that_ends_within_its_last_number_is_refused(bench):
    text = (bench.folder / "run.csv").read_text()
    bench.csv(text[:-15])
    assert re.search(
        r"run.csv: ends within line 401: its last number, '\S+', is shorter than the 20 above it; copy the file "
        "again, or end that line if the file is whole",
        bench.refusal(),
    )
    bench.csv(text[:-15] + "\n")
    assert bench.load().runs[0].n_samples == 400
    # Cut between two numbers it is refused for that; without only the last line end nothing is wrong with it.
    bench.csv(text[: text.rindex(",")])
    assert "line 401 has 2 fields and line 1 has 3: the file ends there, cut off" in bench.refusal()
    bench.csv(text.rstrip("\n"))
    np.testing.assert_array_equal(bench.load().runs[0].moment, bench.columns["m"])


def test_values_beyond_float64_in_si(bench):
    bench.replace('unit = "N*m"', 'unit = "kN*m"').line(9, "0.035,1e308,0.1")
    with pytest.raises(
        SindyJointError, match="moment: values up to 1e[+]308 are too large in SI; check the unit"
    ):
        bench.load()


def test_a_preamble_is_passed_over(bench):
    text = (bench.folder / "run.csv").read_text()
    bench.csv(f"Test rig 4\nOperator K\n{text}")
    np.testing.assert_array_equal(bench.load().runs[0].moment, bench.columns["m"])
    bench.replace("[channels]", "[channels]\nskip = 2")
    np.testing.assert_array_equal(bench.load().runs[0].moment, bench.columns["m"])
    bench.replace("[channels]", "[channels]\nskip = 1")
    assert "line 3 has 3 fields and line 2 has 1; expected equal numbers" in bench.refusal()
    bench.replace("[channels]", "[channels]")
    bench.csv(f"# Test rig 4\n{text}")
    assert bench.load().runs[0].n_samples == 400


def test_a_units_row_with_a_blank(bench):
    lines = (bench.folder / "run.csv").read_text().split("\n")
    bench.csv("\n".join([lines[0], ",N*m,mrad", *lines[1:]]))
    np.testing.assert_array_equal(bench.load().runs[0].moment, bench.columns["m"])


def test_a_pattern_stands_for_several_runs(bench):
    text = (bench.folder / "run.csv").read_text()
    for number in (1, 2, 10):
        bench.csv(text, f"4Hz-{number}.csv")
    bench.replace('file = "run.csv"', 'file = "4Hz-*.csv"')
    assert [run.name for run in bench.load().runs] == ["4Hz-1", "4Hz-2", "4Hz-10"]
    assert {run.frequency for run in bench.load().runs} == {4.0}
    bench.replace('file = "run.csv"', 'file = "5Hz-*.csv"')
    with pytest.raises(SindyJointError, match=r"\[\[run\]\] 1 file: no file matches '5Hz-\*.csv'"):
        bench.load()
    bench.replace('file = "run.csv"', 'file = "4Hz-*.csv"\nname = "four"')
    with pytest.raises(SindyJointError, match="name 'four' would stand for 3 runs"):
        bench.load()


def test_channels_in_separate_files_on_one_time_base(bench):
    rows = [bench.columns[name].tolist() for name in "tma"]
    bench.csv("t,m\n" + "\n".join(f"{t!r},{m!r}" for t, m, _ in zip(*rows, strict=True)) + "\n", "moment.csv")
    bench.csv("t,a\n" + "\n".join(f"{t!r},{a!r}" for t, _, a in zip(*rows, strict=True)) + "\n", "angle.csv")
    bench.replace(
        'file = "run.csv"',
        'file = "moment.csv"\nchannels.angle = { file = "angle.csv", column = "a", unit = "mrad" }',
    )
    run = bench.load().runs[0]
    np.testing.assert_allclose(run.angle, 1e-3 * bench.columns["a"])
    np.testing.assert_array_equal(run.moment, bench.columns["m"])
    short = list(zip(*rows, strict=True))[:-5]
    bench.csv("t,a\n" + "\n".join(f"{t!r},{a!r}" for t, _, a in short) + "\n", "angle.csv")
    # Each has its time: what both have is read.
    run = bench.load().runs[0]
    np.testing.assert_allclose(run.angle[run.valid], 1e-3 * bench.columns["a"][:-5])
    bench.csv("a\n" + "\n".join(f"{a!r}" for _, _, a in short) + "\n", "angle.csv")
    with pytest.raises(
        SindyJointError, match="moment has 400 samples, angle has 395 samples; expected equal"
    ):
        bench.load()
