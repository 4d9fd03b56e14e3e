"""Write the guide's page of limits from the records that the package decides by.

python docs/write_policies.py
"""

from __future__ import annotations

import pkgutil
from importlib import import_module
from pathlib import Path

import sindyjoint
from sindyjoint.policy import described

PAGE = Path(__file__).parent / "guide" / "policies.md"

HEAD = """\
# The limits that decide an answer

Whether a term is found, a run repeats, a model passes or a joint stands out is decided by limits. Each stands in one
place, the `policy.py` of its folder; this page is written from there by `docs/write_policies.py`. Grids, numbers of
iterations and tolerances of solvers decide no answer and are not listed. Where the source says *chosen by judgement*,
no calibration is recorded.
"""


def folders() -> list[str]:
    """Return the parts of the package that have a policy, by their dotted names."""
    modules = pkgutil.walk_packages(sindyjoint.__path__, "sindyjoint.")
    return sorted(m.name for m in modules if m.name.endswith(".policy") and m.name.count(".") > 1)


def page() -> str:
    """Return the page."""
    parts = [HEAD]
    for name in folders():
        module = import_module(name)
        folder = name.removeprefix("sindyjoint.").removesuffix(".policy").replace(".", "/")
        rows = [
            f"| `{item.name}` | {item.value!r} | {item.unit} | {item.meaning} | {item.source} |"
            for item in described(module.POLICY)
        ]
        head = ["| limit | value | unit | decides | source |", "|---|---|---|---|---|"]
        parts.append("\n".join([f"## {folder}\n", f"{module.__doc__.strip()}\n", *head, *rows]) + "\n")
    return "\n".join(parts)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
