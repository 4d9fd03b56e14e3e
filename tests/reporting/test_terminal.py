"""What a person reads in a terminal, held against files: numbers rounded as a physicist would, nothing cut off."""

import re
import sys
from pathlib import Path

import pytest
from handmade import trust

from sindyjoint import JointModel
from sindyjoint.discovery.delay import ChannelDelay
from sindyjoint.equation import Fitted, ModelTerm, load_catalogue
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.judgement.verdict import Verdict
from sindyjoint.record import Joint
from sindyjoint.reporting import pretty_unit, show

GOLDEN = Path(__file__).resolve().parents[1] / "golden"


def model(motion, values, **joint):
    """A model with given coefficients and errors; nothing is computed."""
    library = load_catalogue("extended").union(load_catalogue("inertia"))
    terms = []
    for term_id, (value, error, share) in values.items():
        term = library[term_id]
        interval = (value - 2 * error, value + 2 * error)
        terms.append(
            ModelTerm(
                term.id, term.symbol, term.name, term.family, term.formula, (), term.unit_for(motion), value, error,
                interval, share,
            )
        )  # fmt: skip
    frequencies = (3.0, 4.5) if motion == "rotation" else ()
    fitted = Fitted(3.554, 0.0354, 0.0346, 0.54, 55494, 12, 8e-4, 0.03, frequencies, motion == "rotation")
    return JointModel(Joint(motion=motion, **joint), tuple(terms), (), fitted)


def result(made, verdict, skew=None, warnings=(), reason=""):
    found = bool(made.terms)
    given = Discovery(made, verdict, found, reason, skew, warnings, states=(), regressor=None, campaign=None)
    # Nothing is computed: the answer stands where a computed one is kept.
    vars(given)["trust"] = trust(made.joint.motion, found)
    return given


CASES = {
    "rotation": result(
        model(
            "rotation",
            {
                "linear_stiffness": (6065.83, 1.503, 0.272),
                "quadratic_stiffness": (-196125.0, 1183.0, 0.0101),
                "cubic_stiffness": (-2.6738e9, 5.07e6, 0.041),
                "linear_damping": (48.188, 0.0328, 0.094),
                "coulomb_friction": (1.8656, 0.00059, 0.193),
            },
            name="inter-panel joint",
            inertia=0.02,
        ),
        Verdict("confirmed", (), (), "exactly the paper's five terms out of 24 candidates"),
        ChannelDelay(2e-6, 1.7e-5),
        ("the campaign is simulated (a virtual test), not measured",),
    ),
    "translation": result(
        model(
            "translation",
            {
                "linear_stiffness": (0.99124, 0.00014, 0.78),
                "linear_damping": (2.2505e-4, 1.5e-7, 0.148),
                "cubic_damping": (7.25e-9, 8e-11, 0.012),
                "amplitude_dependent_damping": (-0.00397, 5e-5, 0.014),
                "rate_squared_stiffness": (9.13e-6, 6e-8, 0.018),
                "inertia": (5.3831e-6, 7e-10, 0.923),
            },
            name="circuit [bold]",
        ),
        Verdict("refuted", ("coulomb_friction",), ("cubic_damping",), "the data need cubic damping"),
    ),
    "nothing": result(
        model("rotation", {}, name="noise", inertia=0.0),
        Verdict("undecided", (), (), "no model was found: none stands out"),
        reason="none stands out",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_terminal_is_as_it_was(name, capsys):
    show(CASES[name])
    printed = "".join(line.rstrip() + "\n" for line in capsys.readouterr().out.splitlines())
    # Looked at before it was kept. To renew after an intended change: delete the file, run twice, look again.
    path = GOLDEN / f"terminal-{name}.txt"
    if not path.exists():
        path.write_text(printed, encoding="utf-8")
        pytest.fail(f"{path.name} was missing and has been written; look at it and run again")
    assert printed == path.read_text(encoding="utf-8")


@pytest.mark.parametrize("width", [60, 80, 200])
def test_a_window_cuts_no_number_off(width, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(width))
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    show(CASES["rotation"])
    printed = capsys.readouterr().out
    for number in ("6065.8 ± 1.5", "(−2.674 ± 0.005)·10⁹", "1.8656 ± 0.0006", "N·m·s/rad", "19.3 %"):
        assert number in printed
    assert ("6062.8 … 6068.8" in printed) == (width >= 100)


def test_units():
    assert pretty_unit("N*m/rad^2") == "N·m/rad²" and pretty_unit("kg*m^2") == "kg·m²"


@pytest.mark.parametrize("width", [80, 110])
def test_tables_of_compare_and_batch_fit_the_screen(width, capsys, monkeypatch):
    from handmade_results import comparison

    from sindyjoint.reporting import TextTable, fitting_blocks

    monkeypatch.setenv("COLUMNS", str(width))
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    show(comparison())
    printed = re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out).partition("What next?")[0]
    assert max(map(len, printed.splitlines())) <= width
    assert "residual" in printed and re.search(r"^noise floor +0.97 %", printed, re.M)
    columns = ("campaign", "residual", "floor", *(f"coefficient {i} (N·m·s/rad)" for i in range(5)))
    row = ("joint-1", "1.03 %", "0.97 %", *["5999.3 ± 0.9"] * 5)
    blocks = [block.columns for block in fitting_blocks(TextTable("joints", "", columns, (row,)), width)]
    assert all(block[0] == "campaign" and sum(len(c) + 3 for c in block) <= width for block in blocks)
    assert [c for block in blocks for c in block[1:]] == list(columns[1:])
