"""Coefficients over declared inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sindyjoint.judgement.over_inputs import CoefficientOver, OverInput
from sindyjoint.reporting.data import ReportData
from sindyjoint.reporting.figures.kind import spread
from sindyjoint.reporting.figures.labels import math_symbol, scale_of
from sindyjoint.reporting.style import DASHES, PALETTE, plain, prefixed, pretty_unit
from sindyjoint.text import quantities

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS = 13
# Points of a cycle of the law.
CYCLE = 401


def drawn_over(data: ReportData) -> list[tuple[OverInput, CoefficientOver]]:
    """Return the coefficients that are drawn over an input: those that have something to show."""
    pairs = [(over, row) for over in data.over for row in over.coefficients]
    return spread([(over, row) for over, row in pairs if row.levels or len(set(row.values)) > 1])


def law_at_values(data: ReportData, ax: Axes, over: OverInput) -> Axes:
    """Draw one cycle of the law, through the largest tested angle and rate, at the values of its table."""
    each = next(known for known in data.model.inputs if known.name == over.name)
    fitted, q = data.model.fitted, quantities(data.model.joint.motion)
    phase = np.linspace(0, 2 * np.pi, CYCLE)
    angle, rate = fitted.angle * np.sin(phase), fitted.rate * np.cos(phase)
    laws = [data.model.at(**{over.name: each.zero + each.factor * value}) for value in over.values]
    moments = [law.moment(angle, rate) for law in laws]
    x_factor, x_unit = prefixed(fitted.angle, q.angle_unit)
    y_factor, y_unit = prefixed(float(np.abs(moments).max()), q.moment_unit)
    for moment, heading, colour, dash in zip(moments, over.headings, PALETTE, DASHES, strict=False):
        ax.plot(angle * x_factor, moment * y_factor, color=colour, ls=dash, label=plain(pretty_unit(heading)))
    ax.set(
        xlabel=f"{q.angle} {q.angle_symbol} ({x_unit})",
        ylabel=f"{q.transfer} ({y_unit})",
        title=plain(f"the law over {over.label}\none cycle to the largest {q.angle.lower()}"),
    )
    ax.set_ylim(top=1.5 * y_factor * float(np.max(moments)))
    ax.legend(
        loc="upper center",
        ncols=len(laws),
        frameon=False,
        columnspacing=0.8,
        handlelength=1.4,
        handletextpad=0.4,
    )
    return ax


def coefficient_over(data: ReportData, ax: Axes, over: OverInput, row: CoefficientOver) -> Axes:
    """Draw a coefficient of the law over an input, with its 95 % interval, and the fits to single levels."""
    each = next(known for known in data.model.inputs if known.name == over.name)
    shown = np.linspace(over.values[0], over.values[-1], POINTS)
    laws = [data.model.at(**{over.name: each.zero + each.factor * float(value)}) for value in shown]
    terms = [law[row.id] if row.id in law else None for law in laws]
    values = np.array([0.0 if term is None else term.coefficient for term in terms])
    errors = np.array([0.0 if term is None else term.standard_error for term in terms])
    factor, unit = scale_of(float(np.abs(values).max()), row.unit)
    ax.fill_between(
        shown, factor * (values - 1.96 * errors), factor * (values + 1.96 * errors), color=PALETTE[0], alpha=0.25, lw=0
    )  # fmt: skip
    ax.plot(shown, factor * values, color=PALETTE[0])
    if row.levels:
        own = factor * np.array(row.estimates), 1.96 * abs(factor) * np.array(row.level_errors)
        ax.errorbar(row.levels, own[0], yerr=own[1], fmt="o", markersize=3.5, capsize=2.5, color=PALETTE[1])
    ax.margins(x=0.06, y=0.15)
    ax.set(
        xlabel=plain(
            f"{over.label} ({pretty_unit(over.unit)})" if over.unit not in ("", "1") else over.label
        ),
        ylabel=f"{math_symbol(row.symbol)}" + (f" ({unit})" if unit else ""),
        title=plain(f"{data.model[row.id].name}" + (f"\n{over.dependence(row)}" if row.answer else "")),
    )
    return ax
