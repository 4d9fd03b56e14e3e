"""Pictures of why these terms, coefficients by frequency and over inputs; all figures of a discovery."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from sindyjoint.discovery.frequency import FrequencyTest
from sindyjoint.equation.model import JointModel
from sindyjoint.judgement.comparison import Comparison
from sindyjoint.judgement.over_inputs import CoefficientOver, OverInput
from sindyjoint.paper import FREQUENCIES, TABLES, TERMS
from sindyjoint.reporting.figure import (
    Axes,
    Kind,
    Panel,
    by_name,
    colour_scale,
    fixed,
    math_symbol,
    nothing,
    scale_of,
    spread,
)
from sindyjoint.reporting.results.discovery_data import ReportData
from sindyjoint.reporting.results.discovery_states import (
    cut_at_centre,
    cut_at_zero_rate,
    loop_groups,
    loops,
    map_counts,
    map_moment,
    map_residual,
    residual_phase,
    residual_time,
)
from sindyjoint.reporting.style import (
    ACCENT,
    DASHES,
    DIVERGING,
    FIXED_INK,
    FIXED_PAPER,
    INK,
    MUTED,
    PALETTE,
    RULE,
    plain,
    prefixed,
    pretty_unit,
)
from sindyjoint.text import in_words_of, quantities, spelled

# A parameter counts as the same at two frequencies when it differs by less than this.
EQUIVALENCE = 0.10


def path(data: ReportData, ax: Axes) -> Axes:
    """Draw the residual and the held-out error over the number of terms kept, and the chosen model."""
    q = quantities(data.model.joint.motion)
    if not data.path:
        return nothing(ax, data.selection_reason)
    size = np.array([len(step.terms) for step in data.path])
    fitted = np.array([step.residual_rms for step in data.path])
    held_out = np.array([step.held_out_rms for step in data.path])
    factor, unit = prefixed(float(fitted.max()), q.moment_unit)
    ax.plot(size, fitted * factor, color=PALETTE[0], marker="o", markersize=3, label="residual of the fit")
    if np.isfinite(held_out).any():
        ax.plot(
            size,
            held_out * factor,
            color=PALETTE[1],
            marker="s",
            markersize=3,
            linestyle="--",
            label="held-out error",
        )
    floor = data.model.fitted.noise_floor
    if np.isfinite(floor) and floor > 0:
        ax.axhline(floor * factor, color=MUTED, linewidth=1.6, zorder=1, label="noise floor")
    if data.chosen is not None:
        ax.axvline(size[data.chosen], color=INK, linewidth=0.8, linestyle=":")
    ax.set(yscale="log", xlabel="Terms kept", ylabel=f"RMS ({unit})")
    from matplotlib.ticker import MaxNLocator, NullLocator

    ax.yaxis.set_minor_locator(NullLocator())
    ax.set_title("Path of models" + _chosen_note(data, size, "dotted"))
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.legend(loc="best")
    return ax


def threshold(data: ReportData, ax: Axes) -> Axes:
    """Draw how many terms survive a threshold on the unique share."""
    if not data.path:
        return nothing(ax, data.selection_reason)
    size = np.array([len(step.terms) for step in data.path])
    # A model stands for every threshold up to its weakest term; larger models with weaker terms come first.
    limit = np.maximum.accumulate(np.array([max(step.threshold, 1e-9) for step in data.path]))
    edges = np.concatenate([[limit[0] / 3], limit])
    ax.stairs(size, edges, baseline=None, color=PALETTE[0], linewidth=1.2)
    ax.set_xscale("log")
    if data.chosen is not None:
        chosen = data.chosen
        low = limit[chosen - 1] if chosen else edges[0]
        if limit[chosen] > low:
            ax.axvspan(low, limit[chosen], color=PALETTE[4], alpha=0.25, linewidth=0)
    ax.set(
        xlabel="Threshold (unique share of the RMS)",
        ylabel="Terms kept",
        title="Terms over the threshold" + _chosen_note(data, size, "shaded"),
    )
    from matplotlib.ticker import LogLocator, NullLocator

    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_locator(LogLocator(numticks=7))
    return ax


def coefficient(data: ReportData, ax: Axes, term: str = "") -> Axes:
    """Draw one coefficient for each single frequency, with 95 % intervals, a ±10 % band and the paper's values."""
    ids = data.model.ids
    index = ids.index(term) if term else 0
    item = data.model.terms[index]
    factor, unit = scale_of(item.coefficient, item.unit)
    groups = data.groups
    x = np.arange(len(groups))
    values = np.array([group.coefficients[index] for group in groups])
    errors = np.array([group.standard_errors[index] for group in groups])
    published = paper_values(data.model.joint.name, item.id)
    shown = [(i + 0.18, published[g.group] * factor) for i, g in enumerate(groups) if g.group in published]
    _estimates(ax, x, values * factor, errors * abs(factor), (item.coefficient * factor, EQUIVALENCE), shown)
    ax.set_xticks(x, [plain(group.group) for group in groups])
    if len(groups) > 6:
        ax.tick_params(axis="x", rotation=60)
    ax.set(
        xlim=(-0.6, len(groups) - 0.4),
        ylabel=f"{math_symbol(item.symbol)}" + (f" ({unit})" if unit else ""),
        title=plain(in_words_of(data.model.joint.motion, item.name)),
    )
    return ax


def dependence(result: Comparison, ax: Axes, test: FrequencyTest) -> Axes:
    """Draw a coefficient by frequency, with 95 % intervals, the margin of equivalence and the answer of its tests."""
    factor, unit = scale_of(test.mean, result.units.get(test.name, ""))
    frequencies = np.array(test.frequencies)
    values, errors = np.array(test.estimates), np.array(test.standard_errors)
    published, aside = paper_values(result.joint, test.name), 0.03 * float(np.ptp(frequencies))
    names = [(f, f"{f:.4g} Hz") for f in frequencies]
    shown = [(f + aside, published[name] * factor) for f, name in names if name in published]
    _estimates(
        ax, frequencies, values * factor, errors * abs(factor), (test.mean * factor, test.margin), shown
    )
    ax.margins(x=0.12)
    ax.set(
        xlabel="Frequency (Hz)",
        ylabel=unit,
        title=plain(spelled(test.name, result.motion)) + "\n" + plain(test.answer),
    )
    return ax


def _estimates(
    ax: Axes,
    x: Any,
    values: Any,
    errors: Any,
    band: tuple[float, float],
    published: list[tuple[float, float]],
) -> None:
    """Draw values with 95 % intervals over a centre and its relative margin, with crosses."""
    centre, margin = band
    ax.axhspan(*sorted((centre * (1 - margin), centre * (1 + margin))), color=RULE, alpha=0.6, lw=0)
    ax.axhline(centre, color=INK, linewidth=0.8)
    ax.errorbar(x, values, yerr=1.96 * errors, fmt="o", markersize=3.5, capsize=2.5, color=PALETTE[0])
    shown = [y for _, y in published]
    if shown:
        ax.plot([at for at, _ in published], shown, ls="none", marker="x", markersize=4, color=ACCENT)
    _room(ax, values, errors, centre, shown)


def covariance(data: ReportData, ax: Axes) -> Axes:
    """Draw the correlation of the coefficients' errors."""
    model = data.model
    if not model.terms:
        return nothing(ax, "no terms, no covariance")
    matrix = correlation(model)
    mesh = ax.imshow(matrix, cmap=DIVERGING, vmin=-1, vmax=1)
    names = [math_symbol(term.symbol) for term in model.terms]
    ax.set(xticks=range(len(names)), xticklabels=names, yticks=range(len(names)), yticklabels=names)
    ax.grid(False)
    if len(names) <= 9:
        for (row, column), value in np.ndenumerate(matrix):
            colour = FIXED_PAPER if abs(value) > 0.6 else FIXED_INK
            ax.text(column, row, f"{value:.2f}", ha="center", va="center", fontsize=6.5, color=colour)
    colour_scale(ax, mesh, "correlation")
    ax.set_title("Correlation of the coefficients' errors")
    return ax


def correlation(model: JointModel) -> Any:
    """Return the correlation matrix of a model's coefficients, shape (k, k); the diagonal is one."""
    matrix = np.array(model.covariance, dtype=float).reshape(len(model.terms), len(model.terms))
    size = np.sqrt(np.diag(matrix))
    size[size == 0] = 1.0
    scaled = matrix / np.outer(size, size)
    np.fill_diagonal(scaled, 1.0)
    return scaled


def drawn_coefficients(data: ReportData) -> list[str]:
    """Return the ids whose coefficient by frequency can be drawn."""
    return list(data.model.ids) if data.groups else []


def paper_values(joint: str, term: str) -> dict[str, float]:
    """Return what the paper's table says of a term, by frequency; nothing for a joint or a term that is not in it.

    Examples
    --------
    >>> paper_values("inter-panel joint", "linear_damping")["4 Hz"]
    49.0
    >>> paper_values("other hinge", "linear_damping")
    {}
    """
    for table in TABLES:
        if table.joint == joint.strip().lower() and term in TERMS:
            return {f"{f:.4g} Hz": value for f, value in zip(FREQUENCIES, table.column(term), strict=True)}
    return {}


def _chosen_note(data: ReportData, size: Any, mark: str) -> str:
    return "" if data.chosen is None else f" ({mark}: the chosen {size[data.chosen]})"


def _room(ax: Axes, values: Any, errors: Any, centre: float, shown: list[float]) -> None:
    """Show the band whole, and points outside it, with some room; never an interval that leaves the page."""
    finite = np.isfinite(values)
    reach = [centre * (1 - 1.5 * EQUIVALENCE), centre * (1 + 1.5 * EQUIVALENCE), *shown]
    reach += [*(values - 2.2 * errors)[finite], *(values + 2.2 * errors)[finite]]
    reach = [value for value in reach if np.isfinite(value) and abs(value) < 10 * abs(centre) + 1e-300]
    low, high = min(reach), max(reach)
    if high > low:
        ax.set_ylim(low - 0.06 * (high - low), high + 0.06 * (high - low))


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


def _loops(data: ReportData) -> list[Panel]:
    groups = spread(list(loop_groups(data)))
    return [partial(loops, group=group) for group in groups]


def _residual(data: ReportData) -> list[Panel]:
    periodic = any(loop.residual_over_phase.size for loop in data.loops)
    phase: list[Panel] = [residual_phase] if periodic else []
    return [map_residual, *phase, residual_time]


def _coefficients(data: ReportData) -> list[Panel]:
    return [partial(coefficient, term=term) for term in drawn_coefficients(data)]


def _inputs(data: ReportData) -> list[Panel]:
    laws: list[Panel] = [partial(law_at_values, over=over) for over in data.over if data.model.terms]
    return laws + [partial(coefficient_over, over=over, row=row) for over, row in drawn_over(data)]


def _with_terms(*panels: Panel) -> Callable[[ReportData], list[Panel]]:
    return lambda data: list(panels) if data.model.terms else []


def _fit(data: ReportData) -> list[Panel]:
    # The middle of the frequencies: neither the slowest nor the one that is hardest to follow.
    groups = list(loop_groups(data))
    return [partial(loops, group=groups[len(groups) // 2])]


_WHOLE = (
    Kind(
        "fit",
        "Model over measurement",
        "Transfer moment over angle of the runs at one frequency; black dots are the model where the joint moves.",
        _fit,
    ),
    Kind(
        "map",
        "Force–state map",
        "Transfer moment averaged over cells of angle and rate, samples per cell, and cuts through the map: at "
        "zero rate the friction shows as a step, at the middle angle as a jump of the line.",
        fixed(map_moment, map_counts, cut_at_zero_rate, cut_at_centre),
    ),
    Kind(
        "loops",
        "Moment–angle loops",
        "One period of each run, transfer moment over angle; black dots are the model where the joint moves.",
        _loops,
    ),
    Kind(
        "residual",
        "Residual",
        "Residual over angle and rate, over the phase of the cycle, and over time. Structure that stands above the "
        "noise floor is an effect that the model lacks.",
        _residual,
    ),
    Kind(
        "path",
        "Choice of the terms",
        "Fit residual and held-out error over the number of terms, and the number of terms over the threshold.",
        fixed(path, threshold),
    ),
    Kind(
        "coefficients",
        "Coefficients by frequency, or by part of the record",
        "The chosen terms fitted to each single frequency (or part), with 95 % intervals, the bias of the "
        "processing taken out where it is known. Line: all together. Grey: ±10 %. Crosses: the paper's "
        "tables, where the joint is one of the paper's.",
        _coefficients,
    ),
    Kind(
        "inputs",
        "Coefficients over the inputs",
        "The law at the values of the table, and each coefficient that depends on an input or was tested for it: the "
        "line is the law with its 95 % interval, points are fits to the runs of a single level.",
        _inputs,
    ),
    Kind(
        "covariance",
        "Covariance",
        "Correlation of the coefficients' errors; near ±1 the data cannot distinguish two terms.",
        _with_terms(covariance),
    ),
)

_PARTS: dict[str, tuple[str, Panel]] = {
    "map-moment": (
        "Averaged transfer moment over angle and rate, with the model's contours.",
        map_moment,
    ),
    "map-counts": ("Moving samples in every cell of the force–state map.", map_counts),
    "map-rest": (
        "Cut through the force–state map at zero rate, with the friction step.",
        cut_at_zero_rate,
    ),
    "map-centre": ("Cut through the force–state map at the middle angle.", cut_at_centre),
    "residual-map": ("Mean residual over angle and rate.", map_residual),
    "residual-phase": ("Mean residual over the phase of the cycle.", residual_phase),
    "residual-time": ("RMS residual over time.", residual_time),
    "path-error": ("Fit residual and held-out error over the number of terms.", path),
    "path-threshold": ("Number of terms over the threshold.", threshold),
}

KINDS = {
    **by_name(*_WHOLE),
    **{
        name: Kind(name, name.replace("-", ", "), caption, fixed(panel), part=True)
        for name, (caption, panel) in _PARTS.items()
    },
}
