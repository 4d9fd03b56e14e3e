"""The arrows of the design: layers look down only, and what makes motion never meets what explains it."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "sindyjoint"

# Layer by layer, from the bottom: what each part of the package may import. Itself it always may.
BASE = {
    "errors",
    "inputs",
    "record",
    "text",
    "policy",
    "limits",
    "numeric",
    "documents",
    "hooks",
    "plain",
    "described",
    "trust",
    "rig",
    "measurement",
}
DOOR = BASE | {"files"}
DATA = BASE | {"parallel", "clock", "states", "equation"}
EXPLAINS = DATA | {"discovery", "files"}
RESPONDS = DATA | DOOR | {"mechanics", "discovery", "response"}
DIAGNOSES = RESPONDS | {"soundness", "diagnosis"}
ALLOWED = {
    "errors": set(),
    "text": set(),
    "hooks": set(),
    "plain": {"errors", "text"},
    "described": {"hooks", "plain"},  # what shows results is supplied at the root
    "policy": set(),
    "limits": {"policy"},
    "numeric": set(),
    "inputs": {"errors", "plain"},
    "rig": {"errors", "text"},
    "record": {"errors", "text", "inputs", "plain", "described", "hooks", "rig"},
    "measurement": {
        "errors",
        "hooks",
        "numeric",
        "inputs",
        "policy",
        "limits",
        "rig",
        "record",
    },  # runs are made of what sensors measured
    "documents": {"errors", "text"},
    "clock": set(),
    "parallel": {"errors", "clock"},
    "paper": set(),  # its published numbers: discovery, which must not know the answer, may not see them
    "files": BASE,
    "states": BASE,
    "trust": {"described"},
    "equation": BASE,
    "mechanics": DOOR | {"equation", "clock"},  # rigs are read from files; a formula is a list of operations
    "discovery": DATA | {"files"},  # rows that do not fit in memory are read in segments
    "response": (RESPONDS | {"paper"}) - {"discovery", "response"},  # the paper's law needs no compilation
    "substructure": RESPONDS,
    "soundness": RESPONDS | {"substructure"},  # sensors of a structure are held against each other through it
    "diagnosis": (DIAGNOSES | {"paper", "substructure"}) - {"diagnosis"},
    "planning": DIAGNOSES | {"paper"},
    "judgement": DIAGNOSES | {"paper", "substructure"},
    "workflows": DIAGNOSES | {"paper", "planning", "judgement", "substructure"},
}
BELOW_TOP = DIAGNOSES | {"substructure", "paper", "planning", "judgement", "workflows"}
ALLOWED |= {
    "reporting": BELOW_TOP,
    "export": BELOW_TOP - {"judgement"},
    "cli": BELOW_TOP | {"reporting", "export", "__init__"},
    "__main__": {"cli"},
}
# The entry module of the package names public things of any layer, and fetches them only when asked.
FRONT = "__init__"


def layer_of(module: str) -> str:
    """Return the part of the package that a dotted name belongs to."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else FRONT


@cache
def tree(path: Path) -> ast.Module:
    """Return a file's syntax, parsed once for all tests."""
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def nodes(path: Path) -> tuple[ast.Import | ast.ImportFrom | ast.Call, ...]:
    """Return the imports and calls of a file: its tree is walked once for all tests."""
    return tuple(n for n in ast.walk(tree(path)) if isinstance(n, ast.Import | ast.ImportFrom | ast.Call))


@cache
def imports(path: Path) -> set[str]:
    """Return the dotted names inside sindyjoint that a file imports, wherever in the file and for whatever use."""
    here = ["sindyjoint", *path.relative_to(PACKAGE).with_suffix("").parts]
    names = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = here[: len(here) - node.level] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            # "from sindyjoint import states" imports a layer, "from sindyjoint import __version__" the front door.
            names |= {
                f"{module}.{alias.name}"
                if module == "sindyjoint" and alias.name in [*ALLOWED, FRONT]
                else module
                for alias in node.names
            }
    return {name for name in names if name == "sindyjoint" or name.startswith("sindyjoint.")}


def files() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def test_every_part_of_the_package_has_a_place_in_the_diagram():
    parts = {path.relative_to(PACKAGE).parts[0].removesuffix(".py") for path in files()}
    assert parts - {FRONT} == set(ALLOWED)


def test_imports_point_down():
    for path in files():
        here = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        reached = {layer_of(name) for name in imports(path)} - {here}
        assert here == FRONT or reached <= ALLOWED[here], f"{path} may not import {reached - ALLOWED[here]}"


def test_the_diagram_itself_has_no_circle():
    order: list[str] = []
    left = {part: set(below) - {FRONT} for part, below in ALLOWED.items()}
    while left:
        free = sorted(part for part, below in left.items() if below <= set(order))
        assert free, f"a circle among {sorted(left)}"
        order += free
        left = {part: below for part, below in left.items() if part not in free}
    assert order.index("states") < order.index("discovery") < order.index("workflows") < order.index("cli")


def test_mechanics_and_discovery_never_import_each_other():
    # So that a recovered law is evidence, not an echo of the simulator.
    assert "discovery" not in ALLOWED["mechanics"] and "mechanics" not in ALLOWED["discovery"]


def test_the_check_sees_what_it_forbids(tmp_path, monkeypatch):
    monkeypatch.setitem(globals(), "PACKAGE", tmp_path)
    (tmp_path / "mechanics").mkdir()
    bad = tmp_path / "mechanics" / "bad.py"
    bad.write_text("def f():\n    from ..discovery import model\n    import sindyjoint.cli.app\n")
    assert {layer_of(name) for name in imports(bad)} == {"discovery", "cli"}


@pytest.mark.parametrize("library", ["pysindy", "sklearn"])
def test_a_dependency_has_one_home(library):
    users = set()
    for path in files():
        for node in nodes(path):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
            if any(name.split(".")[0] == library for name in names):
                users.add(path.relative_to(PACKAGE).parts[0].removesuffix(".py"))
    assert users == {"discovery"}


def test_nothing_evaluates_text_or_unpickles():
    for path in files():
        for node in nodes(path):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in {"eval", "exec", "compile", "__import__"}, path
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = {a.name for a in node.names} | {getattr(node, "module", None)}
                assert not names & {"pickle", "dill", "cloudpickle"}, path


def unexplained(text: str) -> list[str]:
    """Return the handlers of any fault that no comment on or before their line gives a reason for."""
    lines = text.splitlines()
    broad = [at for at, line in enumerate(lines) if re.match(r"\s*except( \(?(Base)?Exception\b.*)?:", line)]
    return [lines[at] for at in broad if "#" not in lines[at] and not lines[at - 1].lstrip().startswith("#")]


def test_who_handles_any_fault_says_why():
    for path in [*files(), *sorted((PACKAGE.parent / "benchmarks").glob("*.py"))]:
        assert not unexplained(path.read_text(encoding="utf-8")), path
    assert unexplained("try:\n    f()\nexcept Exception as error:\n    pass") == [
        "except Exception as error:"
    ]


@cache
def known_modules() -> set[str]:
    """Return the dotted names of all files."""
    return {".".join(["sindyjoint", *p.relative_to(PACKAGE).with_suffix("").parts]) for p in files()}


@cache
def modules_of(path: Path) -> dict[str, set[str]]:
    """Return the modules of the package that a file imports from, each with the names that it takes."""
    known = known_modules()
    found: dict[str, set[str]] = {}
    for node in nodes(path):
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                module = inner if inner in known else node.module
                module = module if module in known else f"{module}.__init__"
                found.setdefault(module, set()).add(alias.name)
        called = getattr(node, "func", None)
        if "import_module" in (getattr(called, "attr", ""), getattr(called, "id", "")):
            # A module that is fetched by its name is imported no less.
            found |= {ast.literal_eval(text): set() for text in node.args if isinstance(text, ast.Constant)}
    return {module: names for module, names in found.items() if module in known}


def circles(graph: dict[str, set[str]]) -> list[str]:
    """Return the nodes that lie on a circle, or lead only to such: what remains when free nodes are taken away."""
    graph = {node: set(reached) & set(graph) for node, reached in graph.items()}
    while free := {node for node, reached in graph.items() if not reached}:
        graph = {node: reached - free for node, reached in graph.items() if node not in free}
    return sorted(graph)


def test_no_file_of_a_folder_imports_another_in_a_circle():
    graph = {}
    for path in files():
        name = ".".join(["sindyjoint", *path.relative_to(PACKAGE).with_suffix("").parts])
        graph[name] = set(modules_of(path)) - {name}
    del graph["sindyjoint.__init__"]
    assert circles(graph) == []


# The rooms of a diagnosis, each with those that it may import from. What is alike for campaign and structure (loop,
# ranking, verdict, records) knows neither; the two never meet. Rows, score and search over sets know nothing else.
ROOMS = {
    "evidence": set(),
    "effects": set(),
    "diagnosis": {"evidence", "effects"},
    "campaign": {"evidence", "effects", "diagnosis"},
    "structure": {"evidence", "effects", "diagnosis"},
}


def test_the_rooms_of_a_diagnosis_look_down():
    folders = {path.parent for path in (PACKAGE / "diagnosis").rglob("*.py")}
    assert {folder.name for folder in folders} == set(ROOMS)
    for path in (PACKAGE / "diagnosis").rglob("*.py"):
        here = path.parent.name
        reached = {
            name.split(".")[-2] for name in modules_of(path) if name.startswith("sindyjoint.diagnosis.")
        }
        assert reached <= ROOMS[here] | {here}, path
        outside = {layer_of(name) for name in modules_of(path)} - {"diagnosis"}
        assert here != "evidence" or outside <= {"limits", "numeric"}, path  # neither joints nor runs


def test_figures_know_nothing_of_pages_and_files():
    above = {"view", "registry", "results", "output", "saved", "page"}
    for path in (PACKAGE / "reporting" / "figures").glob("*.py"):
        reached = {name.removeprefix("sindyjoint.reporting.").split(".")[0] for name in modules_of(path)}
        assert not reached & above, path


def test_a_circle_would_be_seen():
    assert circles({"a": {"b"}, "b": {"c"}, "c": set()}) == []
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["a", "b", "c"]


def test_private_names_stay_in_their_module():
    for path in files():
        taken = {f"{module}.{name}" for module, names in modules_of(path).items() for name in names}
        for node in nodes(path):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in {
                "sklearn",
                "joblib",
            }:
                taken |= {f"{node.module}.{alias.name}" for alias in node.names}
        parts = {(name, part) for name in taken for part in name.split(".")}
        private = [n for n, part in parts if part.startswith("_") and part not in ("__init__", "__version__")]
        assert not private, f"{path} takes {private}"


@pytest.mark.parametrize("folder", sorted({p.parent for p in files()}), ids=lambda folder: folder.name)
def test_a_folder_says_in_a_sentence_what_it_holds(folder):
    text = ast.get_docstring(tree(folder / "__init__.py"))
    assert text and text.split("\n")[0].endswith(".") and len(text.split("\n")[0].split()) > 4


def test_rooms_stay_small():
    # A folder that a person can look through; verbs that only call what stands below.
    for folder in {path.parent for path in files()}:
        assert len(list(folder.glob("*.py"))) <= 25, folder
    verbs = [path for path in (PACKAGE / "workflows").glob("*.py") if path.name != "policy.py"]
    assert len(verbs) <= 14
    assert sum(len(path.read_text(encoding="utf-8").splitlines()) for path in verbs) <= 3500
