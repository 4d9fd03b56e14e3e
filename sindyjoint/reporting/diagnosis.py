"""A diagnosis for people: its lines on a terminal, its pictures, its folder."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sindyjoint.reporting.style import (
    DASHES,
    INK,
    MARKERS,
    MUTED,
    PALETTE,
    legend_above,
    pretty_unit,
)
from sindyjoint.reporting.units import quantities
from sindyjoint.text import percent, spelled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from sindyjoint.diagnosis.result import Advice, Diagnosis, Gap, Step

WIDTH = 100
NARROW = 5  # inches, below which a legend has one column
MOST_RIVALS = 4
FAR = 30  # a noise floor so many times below the gap is drawn on a logarithmic scale


def show_diagnosis(result: Diagnosis) -> None:
    """Print verdict, gap by step, where it lies, advice and cautions."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else WIDTH, highlight=False)
    console.print(f"{escape(result.model.joint.name)}: [bold]{result.verdict.replace('_', ' ')}[/]")
    console.print(escape(result.reason) + "\n")
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    gap = f"{quantities(result.model.joint.motion).moment.lower()} gap"
    for heading in ("", gap, "response gap", "probability", "not told apart from"):
        table.add_column(heading, justify="right" if heading.endswith(("gap", "ity")) else "left")
    table.add_row("model alone", *_figures(result.initial), "", "")
    for step in result.steps:
        others = ", ".join(spelled(m) for m in step.members if m != step.effect)
        table.add_row(
            f"+ {spelled(step.effect)}", *_figures(step.gap_after), f"{step.probability:.2f}", others or "–"
        )
    table.add_row("noise floor", *_figures(result.noise_floor), "", "")
    console.print(table)
    for step in result.steps:
        values = ", ".join(
            f"{name} = {value:.4g} {parameter_unit(step, name)}".rstrip()
            for name, value in step.parameters.items()
        )
        dropped = (
            f"; no longer needed: {', '.join(map(spelled, step.terms_dropped))}" if step.terms_dropped else ""
        )
        console.print(f"\n{spelled(step.effect)}: {escape(values)}{dropped}", soft_wrap=False)
    budget = result.budget
    if budget.total > 0:
        parts = ", ".join(
            f"{name} {percent(round(getattr(budget, name) / budget.total, 2))}"
            for name in ("state", "history", "run", "processing", "noise")
        )
        console.print(f"\nthe first gap in mean square: {parts}")
    for place in result.where:
        console.print(f"- {escape(place.words)}")
    for advice in result.advice:
        level = f"{advice.level:.3g} {level_unit(result)}"
        console.print(escape(advice_words(advice, level)))
    if result.hidden is not None:
        console.print(f"\nhidden in this virtual test was: [bold]{spelled(result.hidden)}[/]")
    for warning in result.warnings:
        console.print(f"- {escape(warning)}")


def advice_words(advice: Advice, level: str) -> str:
    """Return in a sentence which run to make, at a level in its unit, or that none would help."""
    *first, last = map(spelled, advice.separates)
    apart = f"to tell {', '.join(first)} and {last} apart"
    if not advice.frequency:
        return f"{apart}: {advice.waveform.removeprefix('none: ')}"
    run = f"a {advice.waveform}, at f = {advice.frequency:.4g} Hz with a peak of {level}"
    return f"{apart}: {run}; the true one should then have a probability of {advice.expected_confidence:.2f}"


def level_unit(result: Diagnosis) -> str:
    """Return the unit of the level of an advised run: of the angle, or of a structure's displacement."""
    from sindyjoint.diagnosis.structure.result import StructureDiagnosis

    rotates = result.model.joint.motion == "rotation" and not isinstance(result, StructureDiagnosis)
    return "rad" if rotates else "m"


def parameter_unit(step: Step, name: str) -> str:
    """Return the unit of a parameter for people; nothing for a plain number."""
    unit = step.units.get(name, "1")
    return "" if unit == "1" else pretty_unit(unit)


def _figures(gap: Gap) -> tuple[str, str]:
    return percent(gap.moment), percent(gap.response)


def write_diagnosis(
    result: Diagnosis,
    folder: str | os.PathLike[str],
    command_line: str | Sequence[str] | None = None,
    seed: object = None,
    files: Sequence[str | os.PathLike[str]] = (),
) -> Path:
    """Write report.html, diagnosis.json, model.json and figures, all of them or none.

    ``model.json`` holds the model with those effects as terms that are functions of angle and rate alone; the others
    are in ``diagnosis.json`` only.

    Parameters
    ----------
    result : Diagnosis
    folder : path
    command_line, seed, files
        For the report's last section; see :func:`sindyjoint.reporting.provenance.provenance`.
    """
    from sindyjoint.reporting.output import draw_all, json_text, write_folder
    from sindyjoint.reporting.provenance import provenance
    from sindyjoint.reporting.result_pages import diagnosis_page
    from sindyjoint.reporting.saved import DATA_FILE, saved_text

    pictures = draw_all(result)
    texts = {
        DATA_FILE: saved_text(result),
        "report.html": diagnosis_page(result, provenance(None, seed, command_line, files), pictures),
        "diagnosis.json": json_text({**result.to_dict(), "reason": result.reason, "hidden": result.hidden}),
        "model.json": (result.whole or result.model).to_json() + "\n",
    }
    return write_folder(folder, pictures, texts)


def gap_by_step(result: Diagnosis, ax: Axes) -> Axes:
    """Draw the moment and response gap after each step, down to the noise floor.

    The scale is logarithmic where the noise lies so far below the gap that a linear one would not show it.
    """
    labels = ["model alone", *(f"+ {spelled(s.effect)}" for s in result.steps)]
    gaps = [result.initial, *(s.gap_after for s in result.steps)]
    names = {"moment": quantities(result.model.joint.motion).moment.lower(), "response": "response"}
    shown = [100 * getattr(gap, name) for gap in gaps for name in names]
    shown = [value for value in shown if value == value and value > 0]
    floors = [100 * getattr(result.noise_floor, name) for name in names]
    # A floor of rounding alone would be all that a picture shows; the legend tells it.
    known = shown + [floor for floor in floors if shown and floor > min(shown) / FAR**2]
    for index, (name, called) in enumerate(names.items()):
        values = [100 * getattr(gap, name) for gap in gaps]
        colour = PALETTE[index]
        ax.plot(
            range(len(gaps)),
            values,
            color=colour,
            ls=DASHES[index],
            marker=MARKERS[index],
            label=f"{called} gap",
        )
        for place, value in enumerate(values):
            if value == value:
                # The larger of the two gaps is told above its mark, the other below.
                other = 100 * getattr(gaps[place], "response" if name == "moment" else "moment")
                below = value < other or (index == 1 and value == other)
                ax.annotate(
                    percent(value / 100),
                    (place, value),
                    # A gap that falls comes from the upper left and leaves to the lower right.
                    (-6, -3) if below else (6, 3),
                    textcoords="offset points",
                    ha="right" if below else "left",
                    va="top" if below else "bottom",
                    color=colour,
                )
        floor = 100 * getattr(result.noise_floor, name)
        if floor == floor:
            label = f"noise floor of the {called}, {percent(floor / 100)}"
            if shown and floor not in known:
                label += ", below the axis"
            ax.axhline(floor, color=colour, lw=0.8, ls=(0, (1, 1.5)), label=label)
    if known and max(known) > FAR * min(known):
        ax.set_yscale("log")
        ax.set_ylim(0.5 * min(known), 2 * max(known))
    elif known:
        ax.set_ylim(0, 1.1 * max(known))
    ax.set_xticks(range(len(labels)), labels)
    ax.set_xlim(-0.3, len(labels) - 0.5)
    ax.set_ylabel("relative RMS (%)")
    ax.set_title("Gap between model and measurement")
    narrow = ax.figure.bbox.width < NARROW * ax.figure.dpi
    legend_above(ax, 4 if narrow else 2, columns=1 if narrow else 2)
    return ax


def budget_parts(result: Diagnosis, ax: Axes) -> Axes:
    """Draw what the first gap is made of, in mean square."""
    names = ("state", "history", "run", "processing", "noise")
    total = result.budget.total or 1.0
    shares = [100 * getattr(result.budget, name) / total for name in names]
    ax.barh(range(len(names)), shares, color=[*PALETTE[:4], MUTED])
    for index, share in enumerate(shares):
        ax.text(share + 0.8, index, f"{share:.1f} %", va="center", color=INK)
    ax.set_yticks(range(len(names)), names)
    ax.invert_yaxis()
    ax.set_xlim(0, 112)
    ax.set_xlabel("share of the mean square gap (%)")
    ax.set_title("Budget of the first gap")
    return ax


def rivals_height(result: Diagnosis) -> float:
    """Return the height of the picture of the rivals, inches: a bar is as thick whatever their number."""
    return 1.1 + 0.28 * sum(1 + len(step.rivals[:MOST_RIVALS]) for step in result.steps)


def rivals(result: Diagnosis, ax: Axes) -> Axes:
    """Draw the probability of the named effect of each step and of its rivals."""
    rows = []
    for index, step in enumerate(result.steps):
        rows.append((f"{index + 1}. {spelled(step.effect)}", step.probability, PALETTE[0]))
        rows += [(f"    {spelled(name)}", p, MUTED) for name, p in step.rivals[:MOST_RIVALS]]
    for place, (_, probability, colour) in enumerate(rows):
        ax.barh(place, probability, height=0.6, color=colour)
        ax.text(probability + 0.008, place, f"{probability:.2f}", va="center", color=INK)
    ax.set_yticks(range(len(rows)), [label for label, _, _ in rows])
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.set_xlim(0, 1.08)
    ax.set_xlabel("probability")
    ax.set_title("Named effects and their rivals")
    return ax
