"""Every id that a detector gives is one that ``--accept`` takes, and the other way round."""

import ast
import json
from pathlib import Path

import sindyjoint.soundness
from tests.doors.inventory import GOLDEN

KINDS = list(json.loads(GOLDEN.read_text(encoding="utf-8"))["faults"])
FOLDER = Path(sindyjoint.soundness.__file__).parent


def test_the_list_of_ids_is_complete():
    texts = set()
    for path in FOLDER.rglob("*.py"):
        if path.name != "finding.py":
            nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            texts |= {n.value for n in nodes if isinstance(n, ast.Constant) and isinstance(n.value, str)}
    assert sorted(KINDS) == list(KINDS) and set(KINDS) <= texts


def test_every_finding_in_the_code_has_a_known_id():
    for path in FOLDER.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            called = (
                getattr(node.func, "id", getattr(node.func, "attr", "")) if isinstance(node, ast.Call) else ""
            )
            if called in ("Finding", "finding"):
                ids = [n.value for n in ast.walk(node.args[0]) if isinstance(n, ast.Constant)]
                assert all(name in KINDS for name in ids), (path.name, ids)
