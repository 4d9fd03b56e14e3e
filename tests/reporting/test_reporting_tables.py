"""Tables, units and the saved records."""

import csv
import io
import json
import math

import numpy as np
import pytest
from handmade import HOSTILE, model, report_data

from sindyjoint.errors import InputError
from sindyjoint.plain import to_plain
from sindyjoint.reporting import (
    DASH,
    TERM_COLUMNS,
    TextTable,
    findings_table,
    model_table,
    prefixed,
    pretty_unit,
    shortened,
    term_rows,
    terminal_table,
    terms_csv,
)
from sindyjoint.reporting import DISCOVERY as VIEW
from sindyjoint.soundness import Finding


def test_values_are_rounded_as_a_physicist_would():
    rows = {row.id: cells for row, cells in zip(term_rows(model()), model_table(model()).rows, strict=True)}
    value, _, interval = rows["cubic_stiffness"][3:6]
    assert rows["linear_stiffness"][3] == "5910 ± 40"
    assert value == "(−2.684 ± 0.012)·10⁹"
    assert interval == "(−2.708 … −2.660)·10⁹"
    assert rows["linear_damping"][4] == "N·m·s/rad"
    assert rows["coulomb_friction"][2] == "sgn(θ̇)"
    assert model_table(model("translation")).rows[0][4] == "N/m"


def test_csv_keeps_every_digit():
    law = model(
        terms=[("a", "k1", 'x,"y"\nz', "stiffness", "theta", "N*m/rad", "N/m", 0.1 + 0.2, 1 / 3, 0.1)]
    )
    rows = list(csv.DictReader(io.StringIO(terms_csv(law))))
    assert tuple(rows[0]) == TERM_COLUMNS
    assert float(rows[0]["coefficient"]) == 0.1 + 0.2 and float(rows[0]["standard_error"]) == 1 / 3
    assert rows[0]["name"] == 'x,"y"\nz'


def test_the_terminal_table_shows_brackets_as_they_are():
    from rich.console import Console

    law = model(terms=[("a", "k1", "[bold]x[/bold]", "stiffness", "theta", "N*m/rad", "N/m", 1.0, 0.1, 0.1)])
    console = Console(width=100, file=io.StringIO())
    console.print(terminal_table(model_table(law)))
    assert "[bold]x[/bold]" in console.file.getvalue()


@pytest.mark.parametrize("value", [3e-10, 2e-6, 4.4e-4, 0.02, 7.0, 290.0, 5e3, 4e7, 2e12])
def test_prefixes_keep_numbers_readable(value):
    factor, unit = prefixed(value, "N*m")
    assert 0.29 < value * factor < 3000 and unit.endswith("N·m")
    prefix = {"G": 1e9, "M": 1e6, "k": 1e3, "": 1.0, "m": 1e-3, "µ": 1e-6, "n": 1e-9}[unit[:-3]]
    assert factor * prefix == pytest.approx(1.0, rel=1e-12)


def test_units_and_names_for_people():
    assert pretty_unit("N*s^2/m**2") == "N·s²/m²"
    assert prefixed(float("nan"), "rad") == (1.0, "rad") and prefixed(0.0, "m") == (1.0, "m")
    assert shortened("a" * 50, 11) == "aaaaa…aaaaa" and shortened(7) == "7"


def test_saved_data_read_back_as_they_were_saved():
    data = report_data(name=HOSTILE, runs=(HOSTILE, "b"))
    text = json.dumps(VIEW.save(data))
    again = VIEW.restore(json.loads(text))
    assert json.dumps(VIEW.save(again)) == text
    assert again.model == data.model
    # Six digits of a moment of some N·m, and the empty cells.
    assert np.allclose(again.loops[0].moment, data.loops[0].moment, rtol=1e-5)
    assert np.array_equal(np.isnan(again.surface.moment), np.isnan(data.surface.moment))
    assert again.surface.count.dtype.kind == "i" and again.loops[0].moving.dtype == bool


def test_what_is_not_finite_is_null():
    assert to_plain((math.nan, math.inf, 1.23456789, np.array([np.nan, 2.0])), digits=6) == [
        None,
        None,
        1.23457,
        [None, 2.0],
    ]
    assert "NaN" not in json.dumps(VIEW.save(report_data()), allow_nan=False)


def damaged(change):
    data = json.loads(json.dumps(VIEW.save(report_data())))
    change(data)
    return data


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ([], "not a saved ReportData: expected a table"),
        (damaged(lambda d: d.pop("verdict")), "not a saved ReportData: key 'verdict' is missing"),
        (
            damaged(lambda d: d["loops"][0].pop("angle")),
            "not a saved ReportData: loops.1: key 'angle' is missing",
        ),
        (
            damaged(lambda d: d["loops"][0].update(angle=["x"])),
            "not a saved ReportData: loops.1.angle: could not convert",
        ),
        (damaged(lambda d: d.update(path=3)), "path: expected a list, not 3"),
        (damaged(lambda d: d.update(verdict=3)), "verdict: expected text in quotes, not 3"),
        (damaged(lambda d: d.update(loops=[])), "not a saved ReportData: expected loops and a square map"),
        (damaged(lambda d: d["model"].pop("terms")), "not a saved ReportData: model: key 'terms' is missing"),
    ],
)
def test_damaged_data_are_refused(data, message):
    with pytest.raises(InputError, match=message.replace("(", r"\(")):
        VIEW.restore(data)


def test_words_begin_at_the_left_and_figures_end_at_the_right():
    rows = (("k1", "5910 ± 40", "N·m/rad", "−0.2 %", "3Hz-low"), ("k2", DASH, "1", "< 0.1", "5Hz"))
    table = TextTable("made", "Made.", ("id", "value", "unit", "change", "run"), rows, text=("run",))
    assert table.is_text == (True, False, True, False, True)
    assert TextTable("none", "None.", ("a",), ()).is_text == (True,)


def test_findings_are_shown_by_the_ids_that_accept_takes():
    finding = Finding("lost_samples", "3Hz", None, "stops", "many", "c1", "repeat")
    table = findings_table([finding])
    assert table.rows[0][:2] == ("lost_samples", "3Hz") and all(table.is_text)
    assert "--accept" in table.title
