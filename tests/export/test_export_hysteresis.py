"""Decks with elements read back: springs, sliders and dashpots as the manuals say, against the model's own elements."""

import re

import numpy as np
import pytest
from test_export_decks import abaqus_blocks, apdl_elements

from sindyjoint.diagnosis import load_effects
from sindyjoint.equation import ElementState, JointElement, Value, formula_text
from sindyjoint.errors import InputError
from sindyjoint.export import TARGETS, BoucWen, Cycles, Gap, LuGre, Maxwell, Slider, export_model, kind_of
from tests.export.made import ELEMENTS

ANGLE, RMS = 7.7e-4, 3.55
BASE = {"linear_stiffness": 6066.0, "linear_damping": 48.13}
DECKS = ("ansys", "abaqus", "nastran")
EXACT = ("jenkins_element", "maxwell_branch", "backlash_play")


def row(export, name):
    (found,) = (r for r in export.fidelity if r.term == name)
    return found


def pairs_along(cycles, pairs):
    """Moment of pairs (stiffness, limit) over the cycles once they repeat."""
    return sum(
        (cycles.slider(np.full(cycles.angle.shape, limit), k) for k, limit in pairs),
        np.zeros(cycles.angle.shape),
    )


def branches_along(cycles, branches):
    """Moment of springs k in series with dashpots c over steady harmonic cycles: k·iωτ/(1 + iωτ)."""
    total = np.zeros(cycles.angle.shape)
    omega = 2 * np.pi / (cycles.step * cycles.angle.shape[1])
    for k, c in branches:
        response = k * (1j * omega * c / k) / (1 + 1j * omega * c / k)
        total += response.real * cycles.angle + response.imag / omega * cycles.rate
    return total


def gaps_along(cycles, gaps):
    """Moment of springs given as curves, in series with sliders (limit, x, y): the spring stays where it slides."""
    total = np.zeros(cycles.angle.shape)
    for limit, x, y in gaps:
        largest = np.interp(limit, y, x)
        total += np.interp(cycles.slider(np.full(cycles.angle.shape, largest), 1.0), x, y)
    return total


def ansys_parts(export):
    elements = apdl_elements(export.files["joint.inp"])
    between = export.files["joint.inp"].count("E,JNTI,JNT_N") + export.files["joint.inp"].count(
        "E,JNT_N,JNTJ"
    )
    sliders = [(r[0], r[4]) for kind, keys, r in elements if kind == "COMBIN40" and not r[5] and keys[3] == 6]
    halves = [r for kind, keys, r in elements if kind == "COMBIN14" and keys[2] == 6]
    curves = [r for kind, keys, r in elements if kind == "COMBIN39" and keys[3] == 6]
    assert between == len(halves) + 2 * len(curves)
    gaps = [(sliders.pop()[1], np.array(c[::2]), np.array(c[1::2])) for c in curves]
    return (
        sliders,
        [(spring[0], damper[1]) for spring, damper in zip(halves[::2], halves[1::2], strict=True)],
        gaps,
    )


def abaqus_parts(export):
    pairs, springs, dampers, curves = [], [], [], []
    nodes = re.findall(r"^(9000\d\d), (\d+), (\d+)$", export.files["joint.inp"], re.M)
    assert len({element for element, *_ in nodes}) == len(nodes)
    for keyword, data in abaqus_blocks(export.files["joint.inp"])[1:]:
        if keyword.startswith("*CONNECTOR FRICTION"):
            assert "COMPONENT=4" in keyword
            pairs.append((float(keyword.split("STIFFNESS=")[1]), data[0][0]))
        elif keyword == "*CONNECTOR ELASTICITY, COMPONENT=4":
            springs.append(data[0][0])
        elif keyword == "*CONNECTOR ELASTICITY, COMPONENT=4, NONLINEAR":
            curves.append(np.array(data).T)
        elif keyword == "*CONNECTOR DAMPING, COMPONENT=4":
            dampers.append(data[0][0])
    gaps = [
        (pairs.pop()[1], x, y) for y, x in curves[1:]
    ]  # the first curve and the first damper are the joint's own
    assert sum("900001" in (i, j) for _, i, j in nodes) == (2 if springs or gaps else 0)
    return pairs, list(zip(springs, dampers[1:], strict=True)), gaps


def nastran_parts(export, tmp_path):
    bdf = pytest.importorskip("pyNastran.bdf.bdf", reason="pyNastran is not installed")
    path = tmp_path / "model.bdf"
    path.write_text("GRID,1\nGRID,2\n" + export.files["joint.bdf"])
    deck = bdf.BDF(debug=None)
    deck.read_bdf(str(path), punch=True, xref=True)
    pairs, limits = [], {}
    for element in deck.elements.values():
        if element.type == "CROD":
            rod, plastic = element.pid_ref, deck.MATS1[element.pid_ref.mid]
            a, b = (deck.nodes[n].xyz for n in element.nodes)
            assert (
                rod.A == 1.0
                and np.linalg.norm(b - a) == 1.0
                and plastic.h == 0.0
                and plastic.Type == "PLASTIC"
            )
            if element.nodes[1] == 900006:
                pairs.append((deck.materials[rod.mid].e, plastic.limit1))
            else:
                limits[element.nodes[1]] = plastic.limit1
    gaps = []
    for element in deck.elements.values():
        if element.type == "CBUSH1D":
            table = deck.tables_d[element.pid_ref.spring_idt]
            assert element.nodes[1] == 900006
            gaps.append((limits[element.nodes[0]], table.x, table.y))
    springs = [e for e in deck.elements.values() if e.type == "CELAS2"]
    dampers = [e for e in deck.elements.values() if e.type == "CDAMP2"]
    for spring, damper in zip(springs, dampers, strict=True):
        assert spring.nodes[1] == damper.nodes[0] and spring.c1 == damper.c2 == 6
        assert spring.nodes[1] in deck.spoints
    return pairs, [(s.k, d.b) for s, d in zip(springs, dampers, strict=True)], gaps


@pytest.mark.parametrize("name", ELEMENTS)
@pytest.mark.parametrize("target", DECKS)
def test_a_deck_gives_the_moment_that_its_table_says(make_model, tmp_path, target, name):
    element = ELEMENTS[name]
    model = make_model(BASE, elements=[element])
    export, cycles = export_model(model, target), Cycles.of(model)
    read = {"ansys": ansys_parts, "abaqus": abaqus_parts, "nastran": lambda e: nastran_parts(e, tmp_path)}
    pairs, branches, gaps = read[target](export)
    assert (bool(branches), bool(gaps)) == (name == "maxwell_branch", name == "backlash_play")
    assert bool(pairs) != bool(branches or gaps)
    given = pairs_along(cycles, pairs) + branches_along(cycles, branches) + gaps_along(cycles, gaps)
    exact = cycles.element(element)
    apart = float(np.sqrt(np.mean((given - exact)[cycles.moving] ** 2))) / RMS
    found = row(export, name)
    assert found.carried and found.error == pytest.approx(apart, abs=3e-4)
    assert apart < (3e-4 if name in EXACT else 0.06)
    assert row(export, "all terms").error == pytest.approx(apart, abs=3e-4)


def test_simscape_component_gives_the_rates_and_the_moment(make_model):
    # Its equations, read by a few replacements as Python, at random states.
    model = make_model(BASE, elements=ELEMENTS.values())
    text = export_model(model, "simscape").files["sindyjoint_elements.ssc"]
    values = {
        name: float(value) for name, value in re.findall(r"^    (JOINT_\w+) = \{(\S+), '1'\};", text, re.M)
    }
    names = {"abs": abs, "sign": np.sign, "min": min, "max": max, "exp": np.exp, **values}
    rates = dict(re.findall(r"der\((z\d)\) == \((.*)\)\*\{1, '1/s'\};", text))
    limits = dict(re.findall(r"if abs\((z\d)\) >= (\S+) &&", text))
    (moment,) = re.findall(r"        t == \((.*)\)\*\{1, 'N\*m'\};", text)
    assert len(rates) == 6 and {name: float(v) for name, v in limits.items()} == {"z1": 2e-4, "z2": 2e-4}

    def evaluated(formula, states):
        code = compile(formula.replace("^", "**"), "component", "eval")
        return eval(code, {"__builtins__": {}}, {**names, **states})  # noqa: S307

    rng = np.random.default_rng(2)
    for _ in range(20):
        z, omega = rng.uniform(-2e-4, 2e-4, 6), rng.uniform(-0.04, 0.04)
        states = {"omega": omega, "theta": 0.0, **{f"z{i + 1}": value for i, value in enumerate(z)}}
        total = 0.0
        for index, element in enumerate(ELEMENTS.values()):
            own = {"omega": omega, element.states[0].name: z[index]}
            own |= {p.name: p.value for p in element.parameters}
            rate = eval(element.states[0].rate, {"abs": abs, "exp": np.exp}, own)  # noqa: S307
            assert evaluated(rates[f"z{index + 1}"], states) == pytest.approx(rate, rel=1e-9, abs=1e-12)
            column = element.columns[0]
            shape = eval(column.formula, {"abs": abs, "sign": np.sign, "min": min, "max": max}, own)  # noqa: S307
            total += column.value * shape
        assert evaluated(moment, states) == pytest.approx(total, rel=1e-9)


# Samples are numbers, a column each, and no law.
@pytest.mark.parametrize("target", [target for target in TARGETS if target not in ("fmu", "samples")])
@pytest.mark.parametrize("motion", ["rotation", "translation"])
def test_no_target_drops_an_element_in_silence(make_model, target, motion):
    model = make_model(BASE, motion=motion, elements=[*ELEMENTS.values(), UNLIKE_ANY])
    export = export_model(model, target)
    for element in model.elements:
        found = row(export, element.id)
        text = "".join(content for content in export.files.values() if isinstance(content, str))
        assert element.id in text
        if not found.carried:
            assert target in (*DECKS, "opensees", "mujoco") and element is UNLIKE_ANY
            (said,) = (line for line in export.not_carried if line.startswith(element.id))
            share = np.sqrt(np.mean(Cycles.of(model).element(element)[Cycles.of(model).moving] ** 2)) / RMS
            assert found.error == pytest.approx(share) and f"costs {100 * share:.3g} % of the RMS" in said
    carried = row(export, UNLIKE_ANY.id).carried
    assert carried == (target in ("python", "c", "latex", "json", "simscape"))


# A moment that leads the motion: no spring and slider, no dashpot, gives one.
UNLIKE_ANY = JointElement(
    "active_branch", "active_branch", "k_a", "active branch",
    (Value("k_a", -900.0, 9.0, (-918.0, -882.0), "N*m/rad", "q"),),
    (Value("tau", 0.03, 3e-4, (0.0294, 0.0306), "s"),),
    (ElementState("q", "rad", "omega - q/tau"),),
)  # fmt: skip


def test_kinds_are_known_by_what_they_do(make_model):
    cycles = Cycles.of(make_model())
    kinds = {name: kind_of(element, cycles) for name, element in ELEMENTS.items()}
    assert kinds == {
        "jenkins_element": Slider(5e3, 2e-4),
        "backlash_play": Gap(1.0, 1.2e-4, 0.8e-4),
        "dahl_friction": BoucWen(1e4, 1.0, 1e4, 0.0),
        "bouc_wen_hysteresis": BoucWen(6e3, 2.0, 1 / 2e-4**2, -0.7 / 2e-4**2),
        "lugre_friction": LuGre(2e4, 4e-5, 0.4, 6e-3),
        "maxwell_branch": Maxwell(2e3, 0.03),
    }
    assert kind_of(UNLIKE_ANY, cycles) == Maxwell(-900.0, 0.03)


def test_an_element_of_the_acceleration_is_refused(make_model):
    strange = JointElement(
        "strange", "strange", "k", "strange", (Value("k", 1.0, 0.0, (1.0, 1.0), "", "z*alpha"),), (),
        (ElementState("z", "rad", "omega"),),
    )  # fmt: skip
    with pytest.raises(InputError, match="element 'strange' of the model depends on alpha"):
        export_model(make_model(BASE, elements=[strange]), "json")


def left_by_a_diagnosis(effect, variant, fitted):
    """Return an effect as an element, its parameters in the middle of their ranges."""
    scales = {None: 1.0, "angle": fitted.angle, "rate": fitted.rate}
    middles = {p.name: np.sqrt(p.lower * p.upper) * scales[p.relative_to] for p in variant.parameters}
    return JointElement(
        effect.id,
        effect.id,
        variant.columns[0].symbol,
        effect.name,
        tuple(Value(c.symbol, 1.0, 0.0, (1.0, 1.0), "", c.formula) for c in variant.columns),
        tuple(Value(name, value, 0.0, (value, value), "") for name, value in middles.items()),
        tuple(
            ElementState(s.name, s.unit, formula_text(s.rate), s.limit and formula_text(s.limit))
            for s in variant.states
        ),
    )


def test_every_shipped_effect_with_a_state_is_exported(make_model):
    model, cycles = make_model(), Cycles.of(make_model())
    nearest = {}
    for effect in load_effects():
        for number, variant in enumerate(effect.variants):
            names = {symbol.name for symbol in variant.symbols}
            known = {"theta", "omega", *variant.names, *(state.name for state in variant.states)}
            if not variant.states or effect.enters != "moment" or names - known:
                continue
            element = left_by_a_diagnosis(effect, variant, model.fitted)
            nearest[effect.id, number] = type(kind_of(element, cycles)).__name__
            for target in ("c", "ansys", "mujoco", "opensees"):
                export = export_model(make_model(elements=[element]), target)
                assert row(export, effect.id).carried or export.not_carried
    assert nearest == {
        ("dahl_friction", 0): "BoucWen",
        ("bouc_wen_hysteresis", 0): "BoucWen",
        ("bouc_wen_hysteresis", 1): "BoucWen",
        ("bouc_wen_hysteresis", 2): "BoucWen",
        ("bouc_wen_hysteresis", 3): "BoucWen",
        ("jenkins_element", 0): "Slider",
        ("iwan_microslip", 0): "NoneType",  # four sliders share a coefficient
        ("lugre_friction", 0): "LuGre",
        ("backlash_play", 0): "Gap",
        ("backlash_play", 1): "NoneType",  # Hertz's power is no ramp
        ("maxwell_branch", 0): "Maxwell",
        ("fractional_damping", 0): "NoneType",  # six branches share a coefficient
    }
