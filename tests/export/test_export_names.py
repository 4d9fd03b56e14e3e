"""Names that people give are data: no target lets them become syntax. LaTeX and JSON."""

import ast
import json
import re
import shutil
import subprocess
from dataclasses import replace

import pytest

from sindyjoint import JointModel
from sindyjoint.export import TARGETS, export_model, read_model, write_export
from sindyjoint.text import control_character
from tests.export.made import ELEMENTS

HOSTILE = (
    'evil */ int x; /* "q" \\ ??/ 50% of A_1 & {B} $x$ #1 ~^ \'; system("ls") \n*STEP\r\n/EXIT\u2028ENDDATA """ \x00 '
    "θ Süd \ud800 end\\"
)


@pytest.fixture(scope="module")
def hostile_model(make_model):
    """A model whose joint, term names, symbols and units are all hostile."""
    element = ELEMENTS["jenkins_element"]
    column = replace(element.columns[0], name=HOSTILE, unit=HOSTILE)
    element = replace(element, id=HOSTILE, effect=HOSTILE, symbol=HOSTILE, name=HOSTILE, columns=(column,))
    # A joint with control characters in its name is refused before.
    model = make_model(name="".join(c for c in HOSTILE if control_character(c) is None), elements=[element])
    terms = (replace(model.terms[0], name=HOSTILE, symbol=HOSTILE, unit=HOSTILE), *model.terms[1:])
    return replace(model, terms=terms)


@pytest.mark.parametrize(
    ("target", "mark", "allowed"),
    [
        ("ansys", "!", r"[A-Z/*!]"),
        ("abaqus", "**", r"\*|[-\d]|HINGE,|CARDAN,|SINDYJOINT_AXES,"),
        ("nastran", "$", r"[A-Z1]+\*|\*|\$"),
        ("simscape", "%", r"joint|    [-\d]|%"),
        ("latex", "%", r"\\|%| "),
        ("python", "#", r""),
        ("opensees", "#", r""),
    ],
)
def test_a_hostile_name_never_begins_a_line(hostile_model, make_model, target, mark, allowed):
    hostile, plain = (
        next(iter(export_model(m, target).files.values()))
        for m in (hostile_model, make_model(elements=[ELEMENTS["jenkins_element"]]))
    )
    for line in re.split(r"[\n\r\v\f\x1c-\x1e\x85\u2028\u2029]", hostile):
        assert not line.lstrip().startswith(("*STEP", "/EXIT", "ENDDATA")), line
        assert re.match(allowed, line) or not line
    # What is not comment differs only where the name is quoted as data.
    bare = [[x for x in text.splitlines() if x and not x.startswith(mark)] for text in (hostile, plain)]
    if target in ("ansys", "abaqus", "nastran"):
        assert bare[0] == bare[1]
    else:
        assert len(bare[0]) == len(bare[1])


def test_a_hostile_name_is_text_in_python(hostile_model):
    source = export_model(hostile_model, "python").files["joint.py"]
    tree = ast.parse(source)
    values = {
        node.targets[0].id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and node.targets[0].id == "NAME"
    }
    name = ast.literal_eval(values["NAME"])
    assert name.startswith('evil */ int x; /* "q"') and "\n" not in name


def test_a_hostile_name_is_text_in_every_python_script(hostile_model):
    tree = ast.parse(export_model(hostile_model, "opensees").files["joint_opensees.py"])
    calls = {
        node.func.attr for node in ast.walk(tree) if isinstance(node, ast.Call) and hasattr(node.func, "attr")
    }
    assert calls <= {"uniaxialMaterial", "element", "node", "nodeCoord", "nodeDisp", "equalDOF"}


def test_a_hostile_name_is_text_in_mjcf(hostile_model, make_model):
    from xml.etree import ElementTree

    hostile, plain = (
        ElementTree.fromstring(export_model(m, "mujoco").files["joint.xml"])
        for m in (hostile_model, make_model(elements=[ELEMENTS["jenkins_element"]]))
    )
    assert hostile.get("model").startswith('evil */ int x; /* "q"')
    assert [(node.tag, len(node.attrib)) for node in hostile.iter()] == [
        (node.tag, len(node.attrib)) for node in plain.iter()
    ]


def test_a_hostile_name_is_comment_in_a_component(hostile_model):
    lines = export_model(hostile_model, "simscape").files["sindyjoint_elements.ssc"].splitlines()
    code = [line.split("%")[0] for line in lines]
    assert not any(
        word in line
        for line in code
        for word in ("evil", "STEP", "system", "ENDDATA")
        if "JOINT_" not in line
    )
    assert all(line.isascii() for line in lines)


def test_a_hostile_name_is_text_in_c(hostile_model, tmp_path):
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler is installed")
    write_export(export_model(hostile_model, "c"), tmp_path / "joint.h")
    (tmp_path / "main.c").write_text(
        '#include <stdio.h>\n#include "joint.h"\nint main(void) { puts(JOINT_NAME); return 0; }\n'
    )
    flags = [
        "-std=c99",
        "-trigraphs",
        "-Wall",
        "-Wextra",
        "-Wno-unused-variable",
        "-Wno-unused-const-variable",
        "-Werror",
    ]
    subprocess.run([compiler, *flags, "main.c", "-lm", "-o", "main"], cwd=tmp_path, check=True)
    printed = subprocess.run([str(tmp_path / "main")], capture_output=True, check=True).stdout.decode()
    assert printed.startswith('evil */ int x; /* "q" \\ ??/ 50% of A_1') and "Süd" in printed


def test_a_hostile_name_makes_a_valid_fmu(hostile_model, tmp_path):
    pytest.importorskip("pythonfmu", reason="pythonfmu (extra 'fmu') is not installed")
    validation = pytest.importorskip("fmpy.validation", reason="fmpy is not installed")
    (path,) = write_export(export_model(hostile_model, "fmu"), tmp_path / "joint.fmu")
    assert validation.validate_fmu(str(path)) == []


def test_latex_prints_hostile_names_and_balances_its_braces(hostile_model):
    text = export_model(hostile_model, "latex").files["joint.tex"]
    body = "\n".join(line for line in text.splitlines() if not line.startswith("%"))
    bare = re.sub(r"\\[\\{}%&$#_ ,]", " ", body)
    depth = 0
    for character in bare:
        depth += {"{": 1, "}": -1}.get(character, 0)
        assert depth >= 0
    assert depth == 0
    assert "%" not in bare and "#" not in bare
    assert r"50\% of A\_1 \& \{B\} \$x\$ \#1" in body
    rows = body.split(r"\midrule")[1].split(r"\bottomrule")[0].strip().splitlines()
    assert all(re.sub(r"\\&", "", row).count("&") == 3 and row.rstrip().endswith(r"\\") for row in rows)


def test_latex_holds_the_equation_and_every_coefficient(paper_model):
    text = export_model(paper_model, "latex").files["joint.tex"]
    assert paper_model.latex() in text
    for number in (
        r"6066.0 \pm 6.1",
        r"(-1.9270 \pm 0.0019) \cdot 10^{5}",
        r"48.130 \pm 0.048",
        r"1.8670 \pm 0.0019",
    ):
        assert number in text
    assert r"N\,m/rad\textsuperscript{3}" in text


def test_latex_holds_the_rates_and_numbers_of_elements(make_model):
    text = export_model(make_model(elements=ELEMENTS.values()), "latex").files["joint.tex"]
    assert r"\dot{z_{1}} = \dot{\theta},\ |z_{1}| \leq \theta_{y}" in text
    for row in (
        r"$ \theta_{y} $ & $ (2.000 \pm 0.020) \cdot 10^{-4} $",
        "$ shape $ & $ 1.300",
        r"$ \tau $ & $ 0.03000",
    ):
        assert row in text


def test_elements_are_read_back_from_json_too(make_model, tmp_path):
    model = make_model(elements=ELEMENTS.values())
    write_export(export_model(model, "json"), tmp_path)
    assert read_model(tmp_path) == model


def test_json_is_read_back_as_the_same_model(paper_model, tmp_path):
    (path,) = write_export(export_model(paper_model, "json"), tmp_path)
    assert path.name == "model.json"
    assert read_model(tmp_path) == paper_model
    assert [row["term"] for row in json.loads(path.read_text())["fidelity"]] == [
        *paper_model.ids,
        "all terms",
    ]


def test_symbols_that_collide_get_names_of_their_own(make_model):
    model = make_model()
    terms = tuple(
        replace(t, symbol=s) for t, s in zip(model.terms, ["k", "k ", "while", "LOW", "θ"], strict=True)
    )
    clash = JointModel(model.joint, terms, model.covariance, model.fitted)
    namespace = ast.parse(export_model(clash, "python").files["joint.py"])
    names = [
        n.targets[0].id
        for n in namespace.body
        if isinstance(n, ast.Assign) and n.targets[0].id.startswith("JOINT_")
    ]
    assert names == ["JOINT_k", "JOINT_k_2", "JOINT_while", "JOINT_LOW_2", "JOINT_x"]


@pytest.mark.parametrize("target", [target for target in TARGETS if target not in ("json", "fmu", "samples")])
def test_every_text_target_carries_its_fidelity_table(paper_model, target):
    text = next(iter(export_model(paper_model, target).files.values()))
    for word in ("Fidelity over the moving states", "linear_stiffness", "all terms", "inter-panel joint"):
        assert word in text
