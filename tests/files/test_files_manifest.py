"""campaign.toml: what is accepted, and one line that names file and field for what is not."""

import json

import pytest

from sindyjoint.errors import InputError, MissingInputError, SindyJointError
from sindyjoint.files import load_campaign, manifest_schema


def refusal(bench) -> str:
    """Load, and return the one line that refuses."""
    with pytest.raises(SindyJointError) as caught:
        bench.load()
    message = str(caught.value)
    assert "\n" not in message
    assert str(bench.folder) in message
    return message


def test_file_and_folder_give_the_same_campaign(bench):
    by_folder = bench.load()
    by_file = load_campaign(bench.folder / "campaign.toml")
    assert by_folder.runs[0].source == by_file.runs[0].source
    assert (by_folder.runs[0].moment == by_file.runs[0].moment).all()


def test_schema_is_json_and_refuses_unknown_keys():
    schema = json.loads(json.dumps(manifest_schema()))
    assert schema["additionalProperties"] is False
    assert {"joint", "channels", "rig", "run", "simulated"} <= set(schema["properties"])
    assert all(table["additionalProperties"] is False for table in schema["$defs"].values())


def test_everything_about_the_joint_is_kept(bench):
    extra = 'temperature = "23 degC"\nserial = "A-7"\nlabels = { batch = 3, lubricant = "none" }'
    bench.replace('inertia = "0.02 kg*m^2"', f'inertia = "200 kg*cm^2"\n{extra}')
    joint = bench.load().joint
    assert joint.inertia == pytest.approx(0.02)
    assert joint.temperature == pytest.approx(296.15)
    assert joint.serial == "A-7"
    assert joint.labels == {"batch": "3", "lubricant": "none"}


# Each row: what to replace in the good manifest, by what, and what the message must say.
REFUSED = [
    ('unit = "N*m"', 'unti = "N*m"', "[channels] moment: unknown key 'unti'; did you mean 'unit'?"),
    ("[joint]", "[jiont]", "unknown key 'jiont'; did you mean 'joint'?"),
    (
        "frequency = 4.0",
        "frequencyhz = 4.0",
        "[[run]] 1: unknown key 'frequencyhz'; did you mean 'frequency'?",
    ),
    ("level =", "zzz =", "[[run]] 1: unknown key 'zzz'; known keys: channels, file, frequency"),
    ("[channels]", "[channels]\nskw = '1 ms'", "[channels]: unknown key 'skw'; did you mean 'skew'?"),
    ('file = "run.csv"', "", "[[run]] 1: key 'file' is missing"),
    ('column = "m", ', "", "[channels] moment: expected either column (with unit) or constant"),
    (', unit = "N*m"', "", "[channels] moment: key 'unit' is missing"),
    (
        '"0.02 kg*m^2"',
        '"-0.02 kg*m^2"',
        "[joint] inertia: '-0.02 kg*m^2' is negative; expected zero or more",
    ),
    ('"0.02 kg*m^2"', "0.02", "[joint] inertia: expected text in quotes, not 0.02"),
    ('"0.02 kg*m^2"', '"0.02"', "[joint] inertia: '0.02' has no unit; expected a moment of inertia"),
    ('"0.02 kg*m^2"', '"0.02 kg"', "[joint] inertia: unit 'kg' is not a moment of inertia"),
    ('name = "bench"', "name = 7", "[joint] name: expected text in quotes, not 7"),
    ('name = "bench"', 'motion = "sideways"', "[joint] motion: expected 'rotation' or 'translation'"),
    ('name = "bench"', 'mass = "1 kg"', "[joint] mass: belongs to motion = 'translation'"),
    ('name = "bench"', 'temperature = "-300 degC"', "[joint] temperature is"),
    (
        'inertia = "0.02 kg*m^2"',
        'motion = "translation"',
        "[channels] moment: motion is 'translation'; give 'force'",
    ),
    (
        "moment = {",
        "force = {",
        "[channels] force: motion is 'rotation'; give 'moment', or set [joint] motion",
    ),
    ('moment = { column = "m", unit = "N*m" }', "", "[channels]: key 'moment' is missing"),
    ('unit = "N*m"', 'unit = "N"', "[channels] moment: unit 'N' is not a moment; expected a moment"),
    ('unit = "N*m"', 'unit = "mV"', "such as 'N*m' or 'lbf*inch', or gain = '5 N*m/mV'"),
    ('"0.02 kg*m^2"', '"0.02"', "expected a moment of inertia, such as '0.02 kg*m^2'"),
    (
        '"N*m" }',
        '"V", gain = "5" }',
        "[channels] moment gain: '5' has no unit; expected a factor with its unit, such as '5 N*m/V'",
    ),
    ('unit = "mrad"', 'unit = "mradd"', "[channels] angle: unit 'mradd' is unknown"),
    ('unit = "mrad"', 'unit = "mm"', "[channels] angle: unit 'mm' is not an angle"),
    ('unit = "s"', 'unit = "Hz"', "[channels] time: unit 'Hz' is not a time"),
    ('"N*m" }', '"N*m", offset = "1 N" }', "[channels] moment.offset: unit 'N' is not a moment"),
    ('"N*m" }', '"V", gain = "3 N/V" }', "[channels] moment: unit 'V' times gain '3 N/V' is not a moment"),
    (
        'time = { column = "t", unit = "s" }',
        "",
        "[channels]: expected time (a column, or 'none' for quasi-static samples) or rate (such as '1 kHz')",
    ),
    (
        "[channels]",
        '[channels]\nrate = "1 kHz"',
        "expected time (a column, or 'none' for quasi-static samples) or rate (such as '1 kHz'), not both",
    ),
    ('time = { column = "t", unit = "s" }', "rate = -3", "[channels] rate: -3.0; expected a positive rate"),
    ("[channels]", '[channels]\nskew = "1 mm"', "[channels] skew: unit 'mm' is not a time"),
    (
        "[channels]",
        '[channels]\nskew = "1 ms"\nskew_removed = "1 ms"',
        "skew_removed states that it is removed already",
    ),
    (
        'angle = { column = "a", unit = "mrad" }',
        'angle = { constant = "0 rad" }',
        "angle: cannot be a constant",
    ),
    ('column = "m", unit = "N*m"', 'constant = "0 N*m", unit = "N*m"', "a constant carries its unit"),
    ("frequency = 4.0", "frequency = -4.0", "frequency is -4.0 Hz; expected a positive number"),
    ("frequency = 4.0", 'frequency = "4 m"', "[[run]] 1 frequency: unit 'm' is not a frequency"),
    (
        "frequency = 4.0",
        "frequency = [4.0]",
        "[[run]] 1 frequency: expected a number, not [4.0]",
    ),
    (
        "frequency = 4.0",
        'use = "maybe"',
        "[[run]] 1 use: expected 'identify' or 'validate', not 'maybe'",
    ),
    ("[[run]]", "[run]", "[run]: expected a list"),
    ("[joint]", "[joint", "is not valid TOML: "),
    ('file = "run.csv"', 'file = "rum.csv"', "rum.csv: there is no such file; did you mean 'run.csv'?"),
    ('file = "run.csv"', 'file = "run.xls"', "there is no such file"),
    ('file = "run.csv"', f'file = "{"x" * 5000}.csv"', "there is no such file"),
    (
        'unit = "N*m"',
        'unit = "V", gain = "0 N*m/V"',
        "with gain '0 N*m/V' gives the factor 0.0; it wipes out",
    ),
    ('unit = "N*m"', 'unit = "V", gain = "1e308 kN*m/uV"', "gives the factor inf; it wipes out the data"),
    (
        "[channels]",
        '[channels]\nskew = "1e300 s"',
        "skew: removing '1e300 s' takes 2e+302 samples from either end",
    ),
    ('file = "run.csv"', 'file = "."', "is a folder; expected a data file"),
    (
        "[[run]]",
        '[[run]]\nfile = "run.csv"\n[[run]]',
        "run name(s) used twice: run; give each run another name",
    ),
]


@pytest.mark.parametrize(("old", "new", "message"), REFUSED, ids=[row[2][:40] for row in REFUSED])
def test_refusal_names_file_and_field(bench, old, new, message):
    answer = refusal(bench.replace(old, new))
    assert message in answer
    if message.startswith("["):
        assert f"campaign.toml: {message}" in answer


def test_no_manifest(tmp_path):
    with pytest.raises(
        MissingInputError, match="does not exist; expected a campaign.toml, or a folder with one"
    ):
        load_campaign(tmp_path / "nothing.toml")
    with pytest.raises(MissingInputError, match=r"folder '.*' holds no campaign.toml"):
        load_campaign(tmp_path)
    with pytest.raises(MissingInputError, match="does not exist"):
        load_campaign("y" * 5000)


def test_a_data_file_is_no_manifest(bench):
    with pytest.raises(
        InputError, match=r"run.csv: this is not a TOML file; expected a campaign.toml that names it"
    ):
        load_campaign(bench.folder / "run.csv")


def test_empty_manifest(bench):
    assert "campaign.toml: is empty" in refusal(bench.manifest(" \n"))


def test_manifest_without_runs(bench):
    assert "key 'run' is missing" in refusal(bench.manifest('[channels]\nrate = "1 kHz"\n'))
    assert "run: expected at least 1, not 0" in refusal(bench.manifest("run = []\n[channels]\n")).replace(
        "[run]", "run"
    )


def test_manifest_of_rubbish_bytes(bench):
    (bench.folder / "campaign.toml").write_bytes(bytes(range(256)))
    assert "campaign.toml: is not UTF-8 text (byte 128); save it as UTF-8" in refusal(bench)


def test_deeply_nested_manifest(bench):
    assert "campaign.toml: is not valid TOML" in refusal(bench.manifest("x = " + "[" * 100_000))


RIG = """
[channels]
time = { column = "t", unit = "s" }
[rig]
strain = ["m", "m", "n", "n"]
displacement = ["a", "a", "z"]
bending_stiffness = "2333 N*m^2"
section_height = "20 mm"
strain_position_factor = 1.02
joint_length = "60 mm"
[[run]]
file = "run.csv"
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "factor = 1.02",
            "factor = 0.0",
            "[rig] strain_position_factor is 0.0; expected a finite number above zero",
        ),
        (
            "factor = 1.02",
            "factor = 0",
            "[rig] strain_position_factor is 0.0; expected a finite number above zero",
        ),
        ("factor = 1.02", "factor = inf", "[rig] strain_position_factor: expected a finite number"),
        ('"60 mm"', '"0 mm"', "[rig] joint_length is 0.0"),
        ('"20 mm"', '"-20 mm"', "[rig] section_height is -0.02"),
        ('"2333 N*m^2"', '"0 N*m^2"', "[rig] bending_stiffness is 0.0"),
        ('"2333 N*m^2"', '"2333 N*m"', "[rig] bending_stiffness: unit 'N*m' is not a bending stiffness"),
        ('joint_length = "60 mm"', "", "[rig]: key 'joint_length' is missing"),
        ('"m", "m", "n", "n"', '"m", "m", "n"', "[rig] strain: expected at least 4, not 3"),
        ("[rig]", '[rig]\nstrain_unit = "mm"', "[rig] strain_unit: unit 'mm' is not a strain"),
        (
            "[rig]",
            '[rig]\ndisplacement_unit = "mrad"',
            "[rig] displacement_unit: unit 'mrad' is not a length",
        ),
        (
            "[channels]",
            '[channels]\nangle = { column = "a", unit = "rad" }',
            "[rig] displacement gives it already",
        ),
        ('displacement = ["a", "a", "z"]', "", "[channels]: key 'angle' is missing (or [rig] displacement)"),
        ("[channels]", '[joint]\nmotion = "translation"\n[channels]', "[rig] is about rotation"),
    ],
)
def test_rig_refusals(bench, old, new, message):
    bench.csv("t,m,n,a,z\n0,1,2,3,4\n1,2,3,4,5\n2,3,5,1,1\n")
    assert message in refusal(bench.manifest(RIG.replace(old, new)))
