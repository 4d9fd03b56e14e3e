"""No sentence of README or guide states a measured figure: those stand on *Measured*, which the benchmarks write."""

import json
import re
import tomllib
from pathlib import Path

import pytest

from sindyjoint.policy import policies

ROOT = Path(__file__).resolve().parents[2]
GENERATED = {"measured.md", "keys.md"}
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs" / "guide").glob("*.md"))]
#: A share, a ratio, a duration, a size, a count of a count.
FIGURE = re.compile(
    r"(?<![\w.])\d[\d ]*(?:\.\d+)? ?(?:%|per cent|times|ms|s|min|h|[kMG]B|mm|mV|kip)(?!\w)"
    r"|(?<![\w./])\d+ ?(?:of|/) ?\d+"
)
#: What the guide may say: limits, by where they are set, or what is no result of a measurement.
STATED = {
    "check.md": {
        "25.4 times": "an inch in millimetres",
        "2 %": "soundness.usual_uncertainty",
        "1 %": "substructure.small_share",
        "30 %": "substructure.unknown",
    },
    "curves.md": {"0.1 %": "the end of an iteration"},
    "inputs.md": {"5 %": "judgement.level", "1 %": "discovery.strict_level"},
    "joints_in_structures.md": {
        "1.5 times": "response.clearly",
        "1 %": "substructure.small_share",
        "30 %": "substructure.unknown",
    },
    "method.md": {
        "5 %": "states.tolerated",
        "0.2 %": "discovery.accuracy",
        "10 %": "discovery.margin",
        "1 %": "states.small_share",
    },
    "plan.md": {
        "20 %": "planning.large_part",
        "95 of 100": "planning.confident",
        "98 %": "planning.limit_share",
        "92 %": "the largest level of a virtual test",
    },
    "report.md": {
        "20 %": "judgement.large_part",
        "1.1 times": "judgement.predicts",
        "2 times": "judgement.contradicts",
        "1 %": "an example",
        "10 %": "discovery.margin",
    },
    "scaling.md": {"5 %": "shared.level", "20 %": "discovery.large_part"},
    "start.md": {"5 %": "judgement.tolerated"},
}


def figures_in(text):
    """Return the figures of the sentences of a page: not those of code, formulas and confidence levels of 95 %."""
    prose = re.sub(r"```.*?```|`[^`]*`|\$[^$]*\$", "", text, flags=re.S)
    return {found for found in FIGURE.findall(prose) if found != "95 %"}


@pytest.mark.parametrize(
    "page", [page for page in PAGES if page.name not in GENERATED], ids=lambda page: page.name
)
def test_a_page_states_limits_and_no_measured_figure(page):
    # A measured figure: a table of benchmarks/measured.toml, then python benchmarks/write_measured.py
    assert figures_in(page.read_text(encoding="utf-8")) == set(STATED.get(page.name, ()))


@pytest.mark.parametrize(
    ("page", "figure", "place"),
    [(page, *each) for page, stated in STATED.items() for each in stated.items() if "." in each[1]],
)
def test_a_limit_on_a_page_is_that_of_the_code(page, figure, place):
    folder, _, name = place.partition(".")
    number, hundredths = float(re.match(r"[\d.]+", figure)[0]), "%" in figure or "of" in figure
    assert getattr(policies()[folder], name) == pytest.approx(number / 100 if hundredths else number)


@pytest.mark.parametrize(
    "sentence",
    [
        "All 8 of 8 ripples are found.",
        "It takes 2.4 s.",
        "Found in 99.5 % of the cases.",
        "28 times as fast.",
        "50/50 are right.",
        "In 330 MB.",
    ],
)
def test_a_measured_figure_would_be_seen(sentence):
    assert figures_in(sentence) and not figures_in(f"`{sentence}`")


def test_each_table_states_its_truth_and_has_its_rows_from_the_benchmark():
    benchmarks = ROOT / "benchmarks"
    tables = tomllib.loads((benchmarks / "measured.toml").read_text(encoding="utf-8"))["table"]
    assert all(table["truth"] and table["tried"] and "rows" not in table for table in tables)
    used = [name for table in tables for name in table["results"]]
    assert {*used} == {path.name for path in (benchmarks / "results").iterdir()}
    for name in used:
        assert json.loads((benchmarks / "results" / name).read_text(encoding="utf-8")), name
