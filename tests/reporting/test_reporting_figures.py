"""Figures: nothing is cut off, nothing overlaps, no global state, and each panel returns the axes that it was given."""

import subprocess
import sys
import textwrap
import warnings
from itertools import combinations

import numpy as np
import pytest
from handmade import HOSTILE, report_data
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from sindyjoint.errors import UnknownNameError
from sindyjoint.reporting import DISCOVERY as VIEW
from sindyjoint.reporting import (
    DOUBLE_COLUMN,
    SINGLE_COLUMN,
    Kind,
    draw,
    drawable,
    drawing_style,
    figure_bytes,
)
from sindyjoint.reporting.results.structure_joints import RecoveredLoop, StructureFigures
from tests.seeds import slow

CASES = {
    "rotation": {},
    "translation": {"motion": "translation"},
    "aperiodic": {"periodic": False, "runs": ("swing",), "frequencies": (3.0,)},
    "hostile": {"name": HOSTILE, "runs": (HOSTILE, HOSTILE + "2"), "periodic": False},
    "no model": {"terms": []},
    "many runs": {
        "runs": tuple(f"run {i} of a long campaign" for i in range(8)),
        "frequencies": (3.0, 3.0, 4.0, 4.0, 5.0, 5.0, 6.0, 6.0),
    },
}


def laid_out(figure, what):
    """Check that no part of a panel leaves the sheet or lies on another panel."""
    with drawing_style():
        renderer = FigureCanvasAgg(figure).get_renderer()
        boxes = [ax.get_tightbbox(renderer) for ax in figure.axes]
        legends = [(ax, ax.get_legend().get_window_extent(renderer)) for ax in figure.axes if ax.get_legend()]
    sheet = figure.bbox
    for box in boxes:
        # Half a point of rounding of text sizes.
        inside = box.x0 > -0.7 and box.y0 > -0.7 and box.x1 < sheet.x1 + 0.7 and box.y1 < sheet.y1 + 0.7
        assert inside, f"{what}: {box} leaves {sheet}"
    for ax, box in legends:
        # A legend that stands out at the side lies on the numbers of the axis.
        frame = ax.get_window_extent(renderer)
        assert box.x0 > frame.x0 - 2 and box.x1 < frame.x1 + 2, f"{what}: the legend {box} leaves {frame}"
    for one, other in combinations(boxes, 2):
        apart = min(one.x1, other.x1) - max(one.x0, other.x0), min(one.y1, other.y1) - max(one.y0, other.y0)
        assert min(apart) < 0.7, f"{what}: {one} overlaps {other}"


# Where there is more room, the cases of long names and of many panels.
WIDE = ("rotation", "hostile", "many runs")


@pytest.mark.parametrize(
    ("case", "width"),
    [(case, SINGLE_COLUMN) for case in CASES]
    + [(case, DOUBLE_COLUMN) for case in WIDE]
    + slow(*((case, DOUBLE_COLUMN) for case in CASES if case not in WIDE)),
)
def test_nothing_is_cut_off_and_panels_do_not_overlap(case, width):
    data = report_data(**CASES[case])
    for kind in drawable(data):
        laid_out(draw(kind, data, width), f"{case} {kind} {width}")


@pytest.mark.parametrize("kind", [name for name, kind in VIEW.kinds.items() if kind.part])
def test_a_panel_draws_into_axes(kind):
    data = report_data()
    (panel,) = VIEW.kinds[kind].panels(data)
    with drawing_style():
        ax = Figure(figsize=(3.5, 2.5)).add_subplot()
        panel(data, ax)
    assert ax.has_data() and ax.get_title(loc="left")


def test_every_line_survives_grey_printing():
    # Lines that share a panel differ in dash or marker, not only in colour.
    data = report_data()
    for kind in drawable(data, parts=True):
        for ax in draw(kind, data).axes:
            lines = [line for line in ax.get_lines() if not line.get_label().startswith("_")]
            looks = [
                (str(line._unscaled_dash_pattern), line.get_marker(), line.get_linewidth()) for line in lines
            ]
            assert len(set(looks)) == len(looks), f"{kind}: {looks}"


def test_the_same_figure_gives_the_same_bytes():
    data = report_data()
    for suffix in ("svg", "png", "pdf"):
        assert figure_bytes(draw("loops", data), suffix) == figure_bytes(draw("loops", data), suffix)


def test_the_callers_settings_stay_and_do_not_matter():
    import matplotlib

    data = report_data()
    plain = figure_bytes(draw("path", data), "svg")
    with matplotlib.rc_context({"font.size": 31, "axes.facecolor": "red", "text.usetex": False}):
        before = dict(matplotlib.rcParams)
        again = figure_bytes(draw("path", data), "svg")
        assert dict(matplotlib.rcParams) == before
    assert again == plain


def test_drawing_needs_no_pyplot():
    script = """
        import sys
        sys.path.insert(0, {here!r})
        from handmade import report_data
        from sindyjoint.reporting import draw, figure_bytes
        figure_bytes(draw("map", report_data()), "svg")
        assert "matplotlib.pyplot" not in sys.modules
    """
    here = str(__file__).rsplit("/", 1)[0]
    run = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script).format(here=here)], capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr


def test_a_name_in_any_script_draws_without_a_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # The empty box of a letter that no font holds is part of the picture, not a message.
        svg = figure_bytes(
            draw("loops", report_data(runs=("\U00013000\x07关节$", "b"), periodic=False)), "svg"
        )
    assert svg.startswith(b"<?xml")


def test_unknown_kind_names_the_nearest():
    with pytest.raises(
        UnknownNameError,
        match="figure 'loop' is not known; did you mean 'loops'\\? expected one of fit, map, ",
    ):
        draw("loop", report_data())


def test_a_kind_without_content_says_what_there_is():
    with pytest.raises(
        UnknownNameError, match="figure 'covariance' has nothing to show here; one of fit, map, loops"
    ):
        draw("covariance", report_data(terms=[]))


def test_kinds_carry_a_caption_each():
    for name, kind in VIEW.kinds.items():
        assert isinstance(kind, Kind) and kind.name == name
        assert kind.caption.endswith(".") and kind.title


def test_the_friction_step_is_the_models():
    ax = draw("map-rest", report_data()).axes[0]
    (label,) = [text.get_text() for text in ax.texts if "step" in text.get_text()]
    assert label == "step 3.73 N·m"  # 2 M_F = 3.734


def test_the_papers_values_stand_beside_the_papers_joint_only():
    with_paper = draw("coefficients", report_data(name="Inter-panel joint"))
    without = draw("coefficients", report_data())
    crosses = [[len(line.get_xdata()) for ax in figure.axes for line in ax.get_lines() if line.get_marker() == "x"]
               for figure in (with_paper, without)]  # fmt: skip
    # Each of the four terms at 3 and 6 Hz; the paper tested no other frequency of these.
    assert crosses == [[2, 2, 2, 2], []]
    k1 = next(line for line in with_paper.axes[0].get_lines() if line.get_marker() == "x")
    assert np.allclose(k1.get_ydata(), [6153, 6063])


def test_a_joint_without_a_law_has_no_dots_of_one():
    angle = np.linspace(-1e-3, 1e-3, 50)
    for law, drawn in ((np.full(50, np.nan), 1), (3e3 * angle, 2)):
        loop = RecoveredLoop("joint 1", "3Hz", angle, 3e3 * angle, law)
        data = StructureFigures("wing", ("joint 1",), ("a1",), np.ones((1, 1)), (loop,))
        assert len(draw("recovered", data).axes[0].get_legend().get_texts()) == drawn
