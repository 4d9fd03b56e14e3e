"""The paper's printed tables: typed right, recomputed, and what follows from four values."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from sindyjoint import mechanics
from sindyjoint.judgement.paper_tables import check_tables, half_unit, table_findings
from sindyjoint.paper import FREQUENCIES, INTER_PANEL, PANEL_ROOT, PULSE, SYMBOLS, TABLES

SOURCE = Path(__file__).parents[3] / "shared" / "paper" / "tables.toml"


@pytest.mark.shared
def test_tables_are_typed_as_transcribed():
    if not SOURCE.is_file():
        pytest.skip("the transcription of the paper's tables is not next to this checkout")
    given = tomllib.loads(SOURCE.read_text())
    for table, key in ((INTER_PANEL, "inter_panel"), (PANEL_ROOT, "panel_root")):
        source = given[key]
        assert list(FREQUENCIES) == source["frequency_hz"] and table.surface_rms == source["surface_fit_rms"]
        for place, symbol in enumerate(SYMBOLS):
            assert [row[place] for row in table.rows] == source[symbol]
            assert table.average[place] == source["average"][symbol]
            assert table.deviation[place] == source["standard_deviation"][symbol]
    assert PULSE.amplitude_rms_error == given["pulse_verification"]["amplitude_rms_error"]


def test_shipped_joints_are_the_printed_averages():
    for table, law in ((INTER_PANEL, mechanics.INTER_PANEL), (PANEL_ROOT, mechanics.PANEL_ROOT)):
        assert tuple(law.parameters) == table.average and law.name == table.joint


def test_one_printed_figure_does_not_follow_from_its_rows():
    odd = [(c.table, c.symbol) for c in check_tables() if not (c.average_follows and c.deviation_follows)]
    assert odd == [(1, "c1")]
    c1 = next(c for c in check_tables() if (c.table, c.symbol) == (1, "c1"))
    assert c1.average_follows and round(c1.deviation, 4) == 0.8718
    # By hand: deviations −1.4475, 0.8725, 0.3825, 0.1925 from 48.1275.
    assert c1.deviation == pytest.approx(
        np.sqrt((1.4475**2 + 0.8725**2 + 0.3825**2 + 0.1925**2) / 4), rel=1e-9
    )


def test_deviations_are_population_ones():
    for check in check_tables():
        assert check.sample_deviation == pytest.approx(check.deviation * np.sqrt(4 / 3))
        assert abs(check.printed_deviation / check.sample_deviation - 1) > 0.1


@pytest.mark.parametrize(
    ("value", "half"), [(6.153e3, 0.5), (-2.209e5, 50.0), (46.68, 0.005), (1.892, 0.0005)]
)
def test_half_a_printed_unit(value, half):
    assert half_unit(value) == pytest.approx(half)


def test_findings_say_what_four_values_cannot_show():
    sentences = table_findings(check_tables())
    assert sentences[0].startswith(
        "Table 1 prints 0.8651 as the standard deviation of c1; its rows give 0.8718"
    )
    assert any(
        "ruled out for k1 (inter-panel joint), c1 (panel root joint) only" in sentence
        for sentence in sentences
    )
    assert "to be found in four of five such tables" in sentences[-1]
    assert len(check_tables()) == 5 * len(TABLES)
