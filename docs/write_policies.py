"""Write the guide's page of limits from the records that the package decides by.

python docs/write_policies.py
"""

from __future__ import annotations

from pathlib import Path

from sindyjoint.policy import described, policies

PAGE = Path(__file__).parent / "guide" / "policies.md"

HEAD = """\
# The limits that decide an answer

Whether a term is found, a run repeats, a model passes or a joint stands out is decided by limits. Each stands in one
place, the `policy.py` of its folder; this page is written from there by `docs/write_policies.py`. Grids, numbers of
iterations and tolerances of solvers decide no answer and are not listed. Where the source says *chosen by judgement*,
no calibration is recorded.
"""


def page() -> str:
    """Return the page: of a folder's second policy only what differs from its first."""
    parts = [HEAD]
    known = policies()
    for name, policy in known.items():
        folder = name.split()[0]
        limits, intro = described(policy), (type(policy).__doc__ or "").strip()
        first = next(each for each in known.values() if type(each) is type(policy))
        if first is not policy:
            limits = tuple(
                item for item, other in zip(limits, described(first), strict=True) if item != other
            )
            intro = f"What differs from the first policy of `{folder}`."
        rows = [
            f"| `{item.name}` | {item.value!r} | {item.unit} | {item.meaning} | {item.source} |"
            for item in limits
        ]
        head = ["| limit | value | unit | decides | source |", "|---|---|---|---|---|"]
        parts.append("\n".join([f"## {name}\n", f"{intro}\n", *head, *rows]) + "\n")
    return "\n".join(parts)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
