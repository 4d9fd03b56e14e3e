"""Decks read back: small interpreters of what the manuals say the elements do, and pyNastran."""

import re

import numpy as np
import pytest

from sindyjoint.errors import InputError
from sindyjoint.export import export_model, write_export
from sindyjoint.mechanics import PaperLaw

ANGLE, RATE, RMS = 7.7e-4, 4.4e-2, 3.55
LAW = PaperLaw(6.066e3, -1.927e5, -2.684e9, 48.13, 1.867)
POWERS = {
    "linear_stiffness": 6066.0, "constant_moment": 0.25, "quadratic_damping": 300.0, "cubic_damping": 2e3,
    "amplitude_dependent_damping": 2e7, "position_dependent_damping": 1e4, "position_dependent_friction": 500.0,
    "quadratic_position_friction": 4e5, "linear_damping": 40.0, "coulomb_friction": 1.1, "cubic_stiffness": -1e9,
}  # fmt: skip


def commands(text, mark):
    """Lines of a deck without comments."""
    return [line.split(mark)[0].strip() for line in text.splitlines() if line.split(mark)[0].strip()]


def apdl_elements(text):
    """Element name, keys and real constants of each element."""
    elements = []
    for line in commands(text, "!"):
        name, *fields = line.split(",")
        if name == "ET":
            elements.append([fields[1], {}, []])
        elif name == "KEYOPT":
            elements[-1][1][int(fields[1])] = int(fields[2])
        elif name in ("R", "RMORE"):
            elements[-1][2] += [float(v) for v in (fields[1:] if name == "R" else fields)]
    return elements


def apdl_moment(elements, angle, rate, dof):
    """Moment of the elements while they slide, by the element reference of Mechanical APDL."""
    total = np.zeros(angle.shape)
    for kind, keys, real in elements:
        assert keys[3] == dof
        if kind == "COMBIN39":
            assert len(real) <= 40 and (0.0, 0.0) in zip(real[::2], real[1::2], strict=True)
            assert np.all(np.diff(real[::2]) > 0)
            total += np.interp(angle, real[::2], real[1::2])
        elif kind == "COMBIN40":
            k1, c, m, gap, slide, k2 = real
            assert m == gap == 0.0 and (slide > 0) == (k1 > 0) and (k1 or k2)
            total += k2 * angle + c * rate + slide * np.sign(rate)
        else:
            assert kind == "COMBIN37"
            stif, damp, _, on, off, force, *remaining = [*real, *[0.0] * 7][:13]
            c1, c2, fslide = remaining[2], remaining[3], remaining[6]
            assert on == off == 0.0  # always active
            control = {0: angle, 2: rate}[keys.get(1, 0)]
            power = c1 * np.abs(control) ** c2 if c1 else 0.0
            total += force + (damp + power * (keys.get(6) == 2)) * rate
            if keys.get(6) == 8:
                assert stif > 0 and fslide > 0
                total += (fslide + power) * np.sign(rate)
    return total


@pytest.mark.parametrize(("motion", "dof"), [("rotation", 6), ("translation", 1)])
@pytest.mark.parametrize("terms", [None, POWERS], ids=["paper", "powers"])
def test_ansys_elements_give_the_moment_of_the_model(make_model, states, motion, dof, terms):
    model = make_model(terms, motion=motion) if terms else make_model(motion=motion)
    export = export_model(model, "ansys")
    assert export.not_carried == ()
    given = apdl_moment(apdl_elements(export.files["joint.inp"]), *states, dof)
    # The table of 19 points is within 0.4 % of the RMS moment; a 37's FSLIDE has a millionth of its limit to spare.
    assert np.abs(given - model.moment(*states)).max() < 0.004 * RMS


def test_ansys_linear_joint_is_one_combin40(make_model):
    model = make_model({"linear_stiffness": 6066.0, "linear_damping": 40.0, "coulomb_friction": 1.1})
    export = export_model(model, "ansys")
    ((kind, _, real),) = apdl_elements(export.files["joint.inp"])
    assert (kind, real[1], real[4], real[5]) == ("COMBIN40", 40.0, 1.1, 6066.0)
    assert all(r.largest_error < 1e-12 for r in export.fidelity if r.symbol in ("k1", "c1"))


def test_ansys_lists_what_no_element_can_do(make_model):
    # θ·θ̇ changes sign with θ: no power of |θ|. A single dead zone is flat at zero: COMBIN39 wants a rising curve.
    export = export_model(make_model({"asymmetric_damping": 1e4, "dead_zone": 900.0}), "ansys")
    assert [text.split(" ")[0] for text in export.not_carried] == ["asymmetric_damping", "dead_zone"]
    assert "COMBIN37 has powers" in export.not_carried[0]
    assert "must rise on both sides of zero" in export.not_carried[1]
    assert apdl_elements(export.files["joint.inp"]) == []
    # Without stiffness the rig is a mechanism; it is written all the same.
    assert "first frequency with locked joints" in export.files["pulse-rig.inp"]


def test_ansys_negative_friction_is_not_carried(make_model):
    export = export_model(make_model({"linear_stiffness": 6e3, "coulomb_friction": -0.5}), "ansys")
    assert "friction must not be negative" in export.not_carried[0]


def test_ansys_rig_is_the_pulse_rig(paper_model):
    deck = export_model(paper_model, "ansys").files["pulse-rig.inp"]
    lines = commands(deck, "!")
    rows = [line.split(",") for line in lines]
    nodes = {int(r[1]): float(r[2]) for r in rows if r[0] == "N"}
    beams = [(int(r[1]), int(r[2])) for r in rows if r[0] == "E" and len(r) == 3]
    # Two beams of 0.5 m in 8 elements, a pair of nodes at the joint in the middle.
    assert len(beams) == 16 and max(nodes.values()) == pytest.approx(1.0)
    assert sum(nodes[b] - nodes[a] for a, b in beams) == pytest.approx(1.0)
    assert sorted(node for node, x in nodes.items() if x == pytest.approx(0.5)) == [9, 10]
    assert ["CP", "NEXT", "UY", "9", "10"] in rows and "JNTI=9" in lines and "JNTJ=10" in lines
    assert "/INPUT,joint,inp" in lines
    # 50 mm × 20 mm of aluminium: EI = 70e9·0.05·0.02³/12, ρA = 2.7 kg/m; 8 kg at the end.
    (area, iyy, _, izz, *_), *_ = [[float(v) for v in r[1:]] for r in rows if r[0] == "SECDATA"]
    values = {r[1]: float(r[3]) for r in rows if r[0] == "MP"}
    assert values["EX"] * izz == pytest.approx(70e9 * 0.05 * 0.02**3 / 12) and iyy == izz
    assert values["DENS"] * area == pytest.approx(2.7)
    assert [float(r[2]) for r in rows if r[0] == "R" and len(r) == 8] == [8.0]
    # Loss factor 0.004 at the first frequency, 4.0 Hz with the joint slipping (stated in the file of the rig).
    assert values["BETD"] * 2 * np.pi * 4.0 == pytest.approx(0.004, rel=0.02)
    # 65 N for 5 ms.
    table = {}
    for index, column, value in re.findall(r"PULSE\((\d+),([01])\)=(\S+)", deck):
        table.setdefault(int(column), {})[int(index)] = float(value)
    time, force = ([table[c][i] for i in sorted(table[c])] for c in (0, 1))
    assert np.trapezoid(force, time) == pytest.approx(65 * 0.005, rel=1e-5) and np.all(np.diff(time) > 0)


def test_ansys_takes_another_rig_and_gives_every_joint_the_model(paper_model):
    export = export_model(paper_model, "ansys", rig="four-panel-wing")
    assert export.files["four-panel-wing.inp"].count("/INPUT,joint,inp") == 4


def test_ansys_rig_without_a_joint_is_refused(paper_model, tmp_path):
    rig = tmp_path / "stiff.toml"
    rig.write_text(
        'name = "stiff"\n[[chain]]\nbeam = "b"\n'
        'length = "1 m"\nbending_stiffness = "10 N*m^2"\nmass_per_length = "1 kg/m"\n'
        '[pulse]\nshape = "half-sine"\nforce = "1 N"\nduration = "1 ms"\n'
    )
    with pytest.raises(InputError, match="rig 'stiff' has no joint"):
        export_model(paper_model, "ansys", rig=rig)


def abaqus_blocks(text):
    """Keyword line and its data, in order."""
    blocks = []
    for line in text.splitlines():
        if line.startswith("**"):
            continue
        if line.startswith("*"):
            blocks.append((line.upper(), []))
        else:
            blocks[-1][1].append([float(v) for v in line.split(",") if re.fullmatch(r"\s*[-+.\de]+\s*", v)])
    return blocks


@pytest.mark.parametrize(("motion", "component"), [("rotation", 4), ("translation", 1)])
def test_abaqus_connector_gives_the_moment_of_the_model(make_model, states, motion, component):
    extra = {"stribeck_friction": -0.3, "quadratic_position_friction": 4e5, "rate_squared": 50.0}
    terms = {
        "linear_stiffness": 6066.0,
        "cubic_stiffness": -2.684e9,
        "linear_damping": 48.13,
        "coulomb_friction": 1.8,
    }
    model = make_model({**terms, **extra}, motion=motion)
    export = export_model(model, "abaqus")
    assert export.not_carried == ()
    angle, rate = states
    total = np.zeros(angle.shape)
    for keyword, data in abaqus_blocks(export.files["joint.inp"]):
        if keyword.startswith("*CONNECTOR") and "COMPONENT=" in keyword:
            assert f"COMPONENT={component}" in keyword
        if keyword.startswith("*CONNECTOR ELASTICITY"):
            force, position = np.array(data).T
            total += np.interp(angle, position, force)
        elif keyword.startswith("*CONNECTOR DAMPING") and "NONLINEAR" in keyword:
            force, velocity = np.array(data).T
            total += np.interp(rate, velocity, force)
        elif keyword.startswith("*CONNECTOR DAMPING"):
            total += data[0][0] * rate
        elif keyword.startswith("*CONNECTOR FRICTION"):
            assert data[0] == [component]  # the independent component
            force, position = np.array(data[1:]).T
            total += np.interp(angle, position, force) * np.sign(rate)
        elif keyword == "*FRICTION":
            assert data == [[1.0]]
    assert np.abs(total - model.moment(*states)).max() < 0.005 * RMS


def test_abaqus_constant_friction_is_one_number(paper_model):
    blocks = dict(abaqus_blocks(export_model(paper_model, "abaqus").files["joint.inp"]))
    (data,) = (data for keyword, data in blocks.items() if keyword.startswith("*CONNECTOR FRICTION"))
    assert data == [[1.867]]


@pytest.fixture
def read_bulk(tmp_path):
    bdf = pytest.importorskip("pyNastran.bdf.bdf", reason="pyNastran is not installed")

    def read(export):
        (path,) = write_export(export, tmp_path / "joint.bdf")
        lines = path.read_text().splitlines()
        assert max(map(len, lines)) <= 72 and all(line.isascii() for line in lines)
        # The two grid points that the user brings.
        model = tmp_path / "model.bdf"
        model.write_text("GRID,1\nGRID,2\n" + path.read_text())
        deck = bdf.BDF(debug=None)
        deck.read_bdf(str(model), punch=True, xref=True)
        return deck

    return read


def tabled(deck, number, x):
    table = deck.tables_d[number]
    return np.interp(x, table.x, table.y)


def test_nastran_rotation_reads_back_as_the_model(paper_model, read_bulk, states):
    deck = read_bulk(export_model(paper_model, "nastran"))
    bush, nonlinear = deck.properties[900001], deck.properties_mass.get(900001) or deck.pbusht[900001]
    angle, rate = states
    assert bush.Ki[5] == pytest.approx(6066.0, rel=1e-6) and bush.Bi[5] == pytest.approx(48.13)
    assert nonlinear.kn_tables[:5] == [None] * 5
    rate_table = deck.properties[900002].damper_idt
    (mpc,) = deck.mpcs[900007]
    # u(x of the relative point) = θz(far side) − θz(base's side)
    assert list(zip(mpc.nodes, mpc.components, mpc.coefficients, strict=True)) == [
        (900006, "1", 1.0), (2, "6", -1.0), (1, "6", 1.0),
    ]  # fmt: skip
    total = tabled(deck, nonlinear.kn_tables[5], angle) + bush.Bi[5] * rate + tabled(deck, rate_table, rate)
    exact = LAW.moment(angle, rate, np.sign(rate))
    assert np.abs(total - exact).max() < 0.001 * RMS


def test_nastran_translation_reads_back_as_the_model(make_model, read_bulk, states):
    model = make_model({**POWERS, "stribeck_friction": 0.3}, motion="translation")
    export = export_model(model, "nastran")
    deck = read_bulk(export)
    spring = deck.properties[900001]
    assert (spring.spring_type, spring.damper_type) == ("TABLE", "TABLE") and spring.c == 0.0
    coupled = {"amplitude_dependent_damping", "position_dependent_damping", "position_dependent_friction",
               "quadratic_position_friction"}  # fmt: skip
    assert {text.split(" ")[0] for text in export.not_carried} == coupled
    angle, rate = states
    total = tabled(deck, spring.spring_idt, angle) + tabled(deck, spring.damper_idt, rate)
    kept = make_model({k: v for k, v in {**POWERS, "stribeck_friction": 0.3}.items() if k not in coupled})
    assert np.abs(total - kept.moment(angle, rate)).max() < 0.004 * RMS


def matlab_values(text):
    """Numbers of each assignment of a script."""
    text = re.sub(r"\.\.\.[^\n]*\n|%[^\n]*", " ", text)
    return {
        name: [float(v) for v in re.findall(r"[-+]?[\d.]+(?:e[-+]?\d+)?", body)]
        for name, body in re.findall(r"joint\.([\w.]+) = ([^;]*);", text)
        if name != "name"
    }


@pytest.mark.parametrize(("motion", "quantity"), [("rotation", "torque"), ("translation", "force")])
def test_simscape_blocks_give_the_moment_of_the_model(make_model, states, motion, quantity):
    terms = {
        **{k: POWERS[k] for k in ("linear_stiffness", "cubic_stiffness", "linear_damping", "cubic_damping")}
    }
    model = make_model({**terms, "coulomb_friction": 1.1, "stribeck_friction": 0.3}, motion=motion)
    export = export_model(model, "simscape")
    assert export.not_carried == ()
    v = matlab_values(export.files["joint.m"])
    angle, rate = states
    total = np.interp(angle, v["spring.deformation"], v[f"spring.{quantity}"])
    total += np.interp(rate, v["damper.velocity"], v[f"damper.{quantity}"])
    # The Rotational Friction block: Coulomb·tanh(10 ω/ω_brk) + f·ω, and no Stribeck hump when both frictions are equal.
    (coulomb,), (breakaway,) = v[f"friction.coulomb_{quantity}"], v[f"friction.breakaway_{quantity}"]
    (velocity,), (viscous,) = v["friction.breakaway_velocity"], v["friction.viscous_coefficient"]
    assert coulomb == breakaway
    total += coulomb * np.tanh(10 * rate / velocity) + viscous * rate
    assert np.abs(total - model.moment(angle, rate)).max() < 0.004 * RMS
