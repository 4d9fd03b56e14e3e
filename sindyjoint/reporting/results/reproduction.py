"""The reproduction of the paper: its tables and figures again, on a terminal, as a page, as files."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from sindyjoint.judgement.paper_tables import TableCheck
from sindyjoint.numeric import Array
from sindyjoint.paper import FREQUENCIES, PULSE, SYMBOLS, TERMS, UNITS
from sindyjoint.reporting.figure import Kind, by_name, cycled, each, fixed, plot
from sindyjoint.reporting.page import Blocks, Page, section, sentence
from sindyjoint.reporting.results.discovery import state_lines
from sindyjoint.reporting.results.verification import amplitude, period, response_payload, thinned
from sindyjoint.reporting.style import DIVERGING, INK, PALETTE, Axes, pretty_unit
from sindyjoint.reporting.tables import Console, TextTable, csv_records, escape, milliseconds
from sindyjoint.reporting.view import View
from sindyjoint.response.verification import RunVerification
from sindyjoint.states import ForceStates
from sindyjoint.states.surface import ForceStateMap
from sindyjoint.text import percent
from sindyjoint.trust import Light, Trust
from sindyjoint.workflows.reproduce import JointReproduction, Reproduction

TRUTHS = {"plain": "truth: only the model's terms", "richer": "truth: friction that first gives way"}


@dataclass(frozen=True, eq=False)
class JointFigures:
    """What is drawn of one joint.

    Parameters
    ----------
    name : str
    loops : tuple of ndarray, shape (2, n)
        Angle, rad, and moment, N·m, over one period at 3 Hz, level by level.
    surface : ForceStateMap
    """

    name: str
    loops: tuple[Array, ...]
    surface: ForceStateMap


@dataclass(frozen=True, eq=False)
class ReproductionFigures:
    """What the figures of a reproduction are drawn from; saved with them, so that any can be drawn again.

    Parameters
    ----------
    joints : tuple of JointFigures
    linear : ForceStateMap
        Of a linear joint.
    force : ndarray, shape (2, n)
        Time, s, and exciting force, N.
    plain, richer : RunVerification
        Virtual pulse test and model, where the truth holds nothing the model lacks, and where it does.
    """

    joints: tuple[JointFigures, ...]
    linear: ForceStateMap
    force: Array
    plain: RunVerification
    richer: RunVerification


def one_period(state: ForceStates) -> Array:
    """Angle and mean moment of all periods, closed, on a grid of phases."""
    assert state.frequency is not None
    count = 240
    phase = np.mod((state.time - state.time[0]) * state.frequency, 1.0)
    cell = np.minimum((phase * count).astype(int), count - 1)
    number = np.bincount(cell, minlength=count)
    means = [np.bincount(cell, x, minlength=count) / number for x in (state.angle, state.moment)]
    return np.array([np.append(mean, mean[0]) for mean in means])


def loops(joint: JointFigures, ax: Axes) -> None:
    """Draw moment over angle at 3 Hz for some of the levels: one period each (Figure 5)."""
    curves = [
        (1e3 * theta, moment, cycled(place, lw=0.9))
        for place, (theta, moment) in enumerate(joint.loops[:7:2])
    ]
    plot(ax, "Angle $\\theta$ (mrad)", "Moment $M$ (N·m)", curves, f"{joint.name}, 3 Hz")


def surface(of: JointFigures | ForceStateMap, ax: Any) -> None:
    """Draw averaged cells as a surface: of a joint, one on each side of zero rate (Figure 7), or of a linear joint."""
    from matplotlib.ticker import MaxNLocator
    from matplotlib.tri import Triangulation

    joint = of if isinstance(of, JointFigures) else None
    given = of.surface if isinstance(of, JointFigures) else of
    limit = float(np.nanmax(np.abs(given.moment)))
    width = [float(edges[1] - edges[0]) for edges in (given.angle_edges, given.rate_edges)]
    for side in (given.rate > 0, given.rate < 0) if joint else (given.filled,):
        keep = given.filled & side
        x, y, z = given.angle[keep], given.rate[keep], given.moment[keep]
        mesh = Triangulation(x / width[0], y / width[1])
        corners = np.stack([mesh.x, mesh.y], axis=1)[mesh.triangles]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        # Cells that no run passed stay open, but for the gaps between neighbouring rings.
        mesh = Triangulation(1e3 * x, 1e3 * y, mesh.triangles[longest < 8])
        ax.plot_trisurf(
            mesh, z, cmap=DIVERGING, vmin=-limit, vmax=limit, lw=0.15, edgecolor=(0.1, 0.1, 0.1, 0.5)
        )
    ax.set_title(f"{joint.name}, 3 Hz" if joint else "linear joint, 3 Hz")
    ax.set_xlabel("$\\theta$ (mrad)", labelpad=-2)
    ax.set_ylabel("$\\dot{\\theta}$ (mrad/s)", labelpad=0)
    ax.set_zlabel("$M_T$ (N·m)", labelpad=-6)
    ax.tick_params(pad=-2)
    ax.xaxis.set_major_locator(MaxNLocator(4))
    ax.yaxis.set_major_locator(MaxNLocator(4))
    # From where the surface is not seen edge on; drawn smaller, since the layout does not know of axis labels in 3-D.
    ax.view_init(elev=24, azim=-58 if joint else -125)
    ax.set_box_aspect(None, zoom=0.84)


def force(result: ReproductionFigures, ax: Axes) -> None:
    """Draw the pulse (Figure 9)."""
    time, values = result.force
    plot(ax, "Time (ms)", "Force (N)", [(1e3 * time, values, {"color": PALETTE[0]})], "Exciting force")


def displacement(result: ReproductionFigures, ax: Axes, truth: str, until: float, model: bool) -> None:
    """Draw the displacement of the free end in a virtual test (Figure 10), and the model over it (Figure 11)."""
    run = getattr(result, truth)
    kept = run.time <= until
    curves = [
        (run.time[kept], 1e3 * run.measured[kept], {"color": PALETTE[0], "lw": 0.8, "label": "virtual test"})
    ]
    if model and run.simulated is not None:
        look: Any = {"color": INK, "lw": 0.7, "ls": (0, (3, 1.5)), "label": "identified model"}
        curves.append((run.time[kept], 1e3 * run.simulated[kept], look))
    title = TRUTHS[truth] if model else "Displacement of the free end"
    ax.margins(x=0.01)
    plot(ax, "Time (s)", "Displacement (mm)", curves, title, legend="above" if model else "none", columns=2)


def half_cycles(result: ReproductionFigures, ax: Axes, truth: str, draw: Callable[[Any, Axes], None]) -> None:
    """Draw the amplitude or the period by half-cycle of a virtual test and the model."""
    draw(getattr(result, truth), ax)
    ax.set_title(TRUTHS[truth])


_SOLID: dict[str, Any] = {"height": lambda _: 3.2, "projection": "3d"}

KINDS = by_name(
    Kind(
        "figure-05",
        "Figure 5",
        "Figure 5: moment over angle at 3 Hz; four of nine levels, periods averaged.",
        each(lambda result: result.joints, loops),
    ),
    Kind(
        "figure-06",
        "Figure 6",
        "Figure 6: force–state map of a linear spring, mass and damper: an oblique plane.",
        each(lambda result: [result.linear], surface),
        **_SOLID,
    ),
    Kind(
        "figure-07",
        "Figure 7",
        "Figure 7: force–state maps at 3 Hz; moving samples averaged in 24 × 24 cells.",
        each(lambda result: result.joints, surface),
        **_SOLID,
    ),
    Kind("figure-09", "Figure 9", "Figure 9: the exciting force.", fixed(force)),
    Kind(
        "figure-10",
        "Figure 10",
        "Figure 10: displacement of the free end after the pulse, 20 s.",
        fixed(partial(displacement, truth="plain", until=PULSE.compared, model=False)),
        wide=True,
    ),
    Kind(
        "figure-11",
        "Figure 11",
        "Figure 11: virtual test and identified model, first 10 s.",
        fixed(*(partial(displacement, truth=truth, until=10.0, model=True) for truth in TRUTHS)),
    ),
    Kind(
        "amplitude-and-period",
        "Amplitude and period",
        "Amplitude and period by half-cycle, of both virtual tests and the model.",
        fixed(
            *(
                partial(half_cycles, truth=truth, draw=draw)
                for truth in TRUTHS
                for draw in (amplitude, period)
            )
        ),
    ),
)


_LEGEND = (
    "Identified (paper). Deviation: population standard deviation over the frequencies. Furthest: largest distance "
    "of a row from the paper's, in the paper's deviations. Paper's way: cells averaged with the sticking samples in "
    "them, then a surface, on virtual runs at 3 Hz."
)


_MARKS = (
    "does not follow from the printed rows. Possible: the largest change that the four values leave possible at 5 % "
    "risk."
)


def gather(result: Reproduction) -> ReproductionFigures:
    """Return what is drawn of a reproduction."""
    time = np.linspace(-0.005, 0.02, 501)
    values = np.where(time < 0, 0.0, result.pulse.rig.excitation(np.maximum(time, 0.0)))
    return ReproductionFigures(
        joints=tuple(
            JointFigures(joint.table.joint, tuple(map(one_period, joint.loops)), joint.surface)
            for joint in result.joints
        ),
        linear=result.linear,
        force=np.stack([time, values]),
        plain=thinned(result.pulse.plain).runs[0],
        richer=thinned(result.pulse.richer).runs[0],
    )


def _tables(result: Reproduction) -> tuple[TextTable, ...]:
    """Return Tables 1 and 2, and what the printed ones show."""
    checks = check_table(result.checks)
    # Of two columns that only together name a row, one.
    rows = tuple((f"{table}, {parameter}", *others) for table, parameter, *others in checks.rows)
    columns = (", ".join(checks.columns[:2]), *checks.columns[2:])
    return (
        *map(joint_table, result.joints),
        replace(checks, title=f"{checks.title}.", columns=columns, rows=rows),
    )


def _trust(result: Reproduction) -> Trust:
    """Return whether the paper's numbers come back, and what to do next."""
    far, furthest = max((float(joint.largest_error.max()), joint.table.joint) for joint in result.joints)
    error, printed = result.pulse.plain.amplitude_rms_error, PULSE.amplitude_rms_error
    own = "put files of your own runs into a folder, and run there: sindyjoint init ."
    return Trust(
        (
            Light(
                "tables",
                "good" if far < 1 else "poor",
                f"the furthest parameter is {far:.2f} of the paper's standard deviations from its truth, that of the "
                f"{furthest}",
            ),
            Light(
                "pulse",
                "good" if error is not None and error <= printed else "fair",
                f"the model leaves {percent(error)} of the amplitude, the paper prints {percent(printed)}",
            ),
        ),
        ((own, "begin with your own joint"),),
    )


def _page(result: Reproduction, data: ReproductionFigures, show: Blocks) -> Page:
    """Return how near the paper it comes, its tables and figures, what they show and what not."""
    furthest = max(float(joint.largest_error.max()) for joint in result.joints)
    plain, richer = result.pulse.plain, result.pulse.richer
    every, badge, word = (
        ("Every", "confirmed", "within") if furthest < 1 else ("Not every", "refuted", "outside")
    )
    both = f"{percent(richer.amplitude_rms_error)}, {milliseconds(richer.mean_period_difference)}"
    facts = [
        ("Furthest parameter", f"{furthest:.2f}", "of the paper's standard deviation"),
        (
            "Amplitude",
            percent(plain.amplitude_rms_error),
            f"the paper prints {percent(PULSE.amplitude_rms_error)}",
        ),
        (
            "Period",
            milliseconds(plain.mean_period_difference),
            f"the paper prints {milliseconds(PULSE.mean_period_difference)}",
        ),
        ("With friction that gives way", both, "amplitude, period: what the model lacks shows"),
    ]
    *joints, printed = _tables(result)
    name = "The paper's joints from virtual tests"
    said = (
        "Everything here is simulated from the paper's printed values: it shows that the pipeline from strains to "
        "tables holds, not that a real joint is like that."
    )
    truths = [replace(getattr(data, truth), name=name) for truth, name in TRUTHS.items()]
    return Page(
        name,
        "The paper's tables and figures again",
        name,
        "",
        (
            show.verdict(
                f"{every} parameter comes back within the paper's standard deviations.", badge, word
            ),
            show.paragraph(said, "reason"),
            show.facts(facts),
        ),
        (),
        (
            section(
                "tables",
                "Identified, and the paper's value in brackets",
                "Tables 1, 2",
                show.paragraph(_LEGEND),
                show.tables(*joints),
            ),
            section(
                "joints",
                "Loops and force–state maps",
                "Loops and maps",
                show.pictures("figure-05", "figure-06", "figure-07"),
            ),
            section(
                "pulse",
                "The pulse on two beams with the joint between them",
                "Pulse",
                show.curves("Virtual test and identified model over time"),
                show.pictures("figure-09", "figure-10", "figure-11", "amplitude-and-period"),
            ),
            section(
                "printed",
                "What the paper's printed tables show",
                "Printed tables",
                show.paragraph(f"“!”: {_MARKS}"),
                show.table(printed),
            ),
            section(
                "limits",
                "What this shows, and what it cannot",
                "What it shows",
                show.items(list(map(sentence, result.statements))),
            ),
        ),
        {"loops": response_payload(truths)},
    )


def _printed(result: Reproduction, console: Console) -> Iterator[Any]:
    """Yield tables and statements."""
    for table in map(joint_table, result.joints):
        yield from (f"{escape(table.title[:-1])}, identified (paper)", table, "")
    yield f"{escape(_LEGEND)}\n"
    yield from _said(result.checks, result.statements)


def _said(checks: Sequence[TableCheck], findings: Sequence[str]) -> list[Any]:
    """Return what the paper's printed tables show."""
    table = check_table(checks)
    return [escape(table.title), table, "", *(f"- {escape(text)}" for text in findings)]


def _details(result: Reproduction) -> Iterator[str]:
    """Yield the states behind each joint's table."""
    for joint in result.joints:
        yield joint.table.joint
        yield from state_lines(joint.loops)
        furthest = ", ".join(f"{value:.2f}" for value in joint.largest_error)
        yield f"furthest of each parameter, in the paper's deviations: {furthest}"


def joint_table(joint: JointReproduction) -> TextTable:
    """Return a table of the paper: identified, and the paper's value in brackets."""
    # Of ten, that k1, k2, k3, c1, M_F are printed in.
    powers = [3, 5, 9, 0, 0]
    units = [
        f"{f'1e{power} ' if power else ''}{pretty_unit(u)}" for u, power in zip(UNITS, powers, strict=True)
    ]
    columns = (f"{symbol} [{unit}]" for symbol, unit in zip(SYMBOLS, units, strict=True))

    def cells(values: Any) -> list[str]:
        return [_four_digits(value) for value in np.asarray(values) / 10.0 ** np.array(powers)]

    paper = joint.table
    lines = [(f"{f:g} Hz", r, p) for f, r, p in zip(FREQUENCIES, joint.rows, paper.rows, strict=True)]
    lines += [("average", joint.average, paper.average), ("deviation", joint.deviation, paper.deviation)]
    rows = (
        *((label, *map("{} ({})".format, cells(ours), cells(theirs))) for label, ours, theirs in lines),
        ("furthest", *(f"{value:.2f}" for value in joint.largest_error)),
        ("paper's way, 3 Hz", *cells(joint.paper_fit.coefficients)),
    )
    return TextTable(f"table-{paper.number}", f"Table {paper.number}: {paper.joint}.", ("", *columns), rows)


def _four_digits(value: float) -> str:
    """Return four digits, trailing zeros included, as the paper prints them."""
    digits = 3 - int(np.floor(np.log10(abs(value)))) if value else 3
    return f"{value:.{max(digits, 0)}f}"


def check_table(checks: Sequence[TableCheck]) -> TextTable:
    """Return what the printed tables say."""
    columns = (
        "table", "parameter", "average", "printed", "s.d.", "printed", "change, 3–6 Hz", "possible", "answer",
    )  # fmt: skip
    rows = tuple(
        (
            str(check.table),
            check.symbol,
            f"{check.average:.4g}",
            f"{check.printed_average:.4g}{'' if check.average_follows else ' !'}",
            f"{check.deviation:.4g}",
            f"{check.printed_deviation:.4g}{'' if check.deviation_follows else ' !'}",
            f"{100 * check.test.change:+.1f} % (p {check.test.p_trend:.2f})",
            f"{100 * check.test.change_bound:.0f} %",
            check.test.answer,
        )
        for check in checks
    )
    return TextTable("printed", "The printed tables, recomputed from their rows", columns, rows)


def page_text(result: Reproduction, captions: Mapping[str, str]) -> str:
    """Return everything as one Markdown page; `captions` of the figures by name."""
    tables = [(table.title[:-1], _LEGEND, table.markdown()) for table in map(joint_table, result.joints)]
    tables.append(("What the printed tables show", check_table(result.checks).markdown(), f"`!`: {_MARKS}"))
    pictures = (f"![{caption}](figures/{name}.svg)\n\n{caption}" for name, caption in captions.items())
    return "\n\n".join(
        [
            "# The paper's tables and figures from virtual tests",
            "\n".join(f"- {text}" for text in result.statements),
            *("\n\n".join((f"## {title}", *parts)) for title, *parts in tables),
            "## Figures",
            *pictures,
            "",
        ]
    )


def tables_csv(result: Reproduction) -> str:
    """Return Tables 1 and 2, identified and printed, as CSV."""
    return csv_records(
        [
            {
                "table": joint.table.number,
                "joint": joint.table.joint,
                "frequency_hz": f,
                "term": term,
                "symbol": symbol,
                "unit": unit,
                "identified": ours,
                "standard_error": error,
                "paper": theirs,
            }
            for joint in result.joints
            for f, *values in zip(FREQUENCIES, joint.rows, joint.errors, joint.table.rows, strict=True)
            for term, symbol, unit, ours, error, theirs in zip(TERMS, SYMBOLS, UNITS, *values, strict=True)
        ]
    )


REPRODUCTION = View(
    about=lambda result: "The paper's tables and figures from virtual tests (simulated)\n",
    data=ReproductionFigures,
    kind="Reproduction",
    folder="reproduction",
    headline=_trust,
    question="What comes back?",
    kinds=KINDS,
    record_file="reproduction.json",
    judged_by=lambda result: ("states", "discovery", "response"),
    # The paper's joints are not at hand.
    simulated=lambda result: True,
    drawn_from=gather,
    tables=_tables,
    page=_page,
    # Everything as one page of Markdown, and the tables as CSV.
    files=lambda result, data: {
        "reproduction.md": page_text(
            result, {name: kind.caption for name, kind in KINDS.items() if kind.panels(data)}
        ),
        "tables.csv": tables_csv(result),
    },
    printed=_printed,
    warnings=lambda result: (),
    details=_details,
)
#: What the paper's printed tables say of themselves.
PRINTED = View(
    printed=lambda result, console: _said(result.printed_tables, result.findings),
    warnings=lambda result: (),
)
