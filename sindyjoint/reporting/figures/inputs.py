"""Coefficients over declared inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sindyjoint.judgement.over_inputs import CoefficientOver, OverInput
from sindyjoint.reporting.data import ReportData
from sindyjoint.reporting.figures.kind import spread
from sindyjoint.reporting.figures.labels import math_symbol, scale_of
from sindyjoint.reporting.style import PALETTE, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS = 13


def drawn_over(data: ReportData) -> list[tuple[OverInput, CoefficientOver]]:
    """Return the coefficients that are drawn over an input: those that have something to show."""
    pairs = [(over, row) for over in data.over for row in over.coefficients]
    return spread([(over, row) for over, row in pairs if row.levels or len(set(row.values)) > 1])


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
    ax.set_xlabel(plain(f"{over.label} ({over.unit})" if over.unit not in ("", "1") else over.label))
    ax.set_ylabel(f"{math_symbol(row.symbol)}" + (f" ({unit})" if unit else ""))
    ax.set_title(plain(f"{data.model[row.id].name}" + (f"\n{row.told}" if row.told else "")))
    return ax
