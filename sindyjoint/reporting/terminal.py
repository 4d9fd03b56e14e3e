"""Results as a person reads them in a terminal; plain text when piped."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from sindyjoint.text import rounded

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from sindyjoint.workflows.discover import Discovery

WIDTH = 100


def show_discovery(result: Discovery) -> None:
    """Print equation, terms, fit, verdict and cautions."""
    from rich.console import Console

    console = Console(width=None if sys.stdout.isatty() else WIDTH, highlight=False)
    model, fitted = result.model, result.model.fitted
    rotation = model.joint.motion == "rotation"
    what, unit = ("moment", "N·m") if rotation else ("force", "N")
    title = f"{model.joint.name}{' (simulated)' if fitted.simulated else ''}"
    at = f" at {', '.join(f'{f:g}' for f in fitted.frequencies)} Hz" if fitted.frequencies else ""
    console.print(f"[bold]{_escaped(title)}[/]: {fitted.runs} run(s){at}, {fitted.samples} moving samples")
    if not result.found:
        console.print(f"\nno model: {_escaped(result.reason)}")
    else:
        console.print(f"\n  {_escaped(model.equation())}\n")
        table = _terms(result, console)
        # A number that is cut off is a wrong number: the table is as wide as it is.
        Console(width=max(console.width, _width(table, console)), highlight=False).print(table)
        console.print(f"\nalone: share of the {what} that no other term can take over")
    inertia = model.joint.inertia
    if inertia is not None:
        console.print(f"inertia {inertia:g} {'kg·m²' if rotation else 'kg'}, declared")
    console.print(
        f"{what} {fitted.moment_rms:.4g} {unit} RMS, residual {fitted.residual_rms:.3g} "
        f"({100 * (fitted.residual_rms / fitted.moment_rms if fitted.moment_rms else 0):.2f} %), "
        f"noise floor {fitted.noise_floor:.3g} {unit}, moving {100 * fitted.moving_fraction:.0f} % of the time"
    )
    if result.skew is not None:
        console.print(
            f"the {what} lags the {'angle' if rotation else 'displacement'} by "
            f"{rounded(1e3 * result.skew.time, 1e3 * result.skew.standard_error)} ms"
        )
    console.print(f"\n[bold]paper's term set {result.verdict.verdict}[/]: {_escaped(result.verdict.reason)}")
    for warning in result.warnings:
        console.print(f"- {_escaped(warning)}")


def _terms(result: Discovery, console: Console) -> Table:
    """Return the table of terms; where a window is too narrow, the interval goes: the uncertainty says as much."""
    table = _table(result, interval=True)
    fits = not sys.stdout.isatty() or _width(table, console) <= console.width
    return table if fits else _table(result, interval=False)


def _width(table: Table, console: Console) -> int:
    from rich.measure import Measurement

    return Measurement.get(console, console.options.update(max_width=1000), table).maximum


def _table(result: Discovery, interval: bool) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    left, right = (dict(justify=side, no_wrap=True, overflow="fold") for side in ("left", "right"))
    columns = {"term": left, "": left, "coefficient": right, "unit": left}
    if interval:
        columns["95 % interval"] = right
    for heading, options in {**columns, "alone": right}.items():
        table.add_column(heading, **options)  # type: ignore[arg-type]
    for term in result.model.terms:
        low, high = term.interval95
        table.add_row(
            term.id,
            _escaped(term.symbol),
            rounded(term.coefficient, term.standard_error),
            pretty_unit(term.unit),
            *([f"{low:.4g} … {high:.4g}"] if interval else []),
            f"{100 * term.unique_share:.1f} %",
        )
    return table


def pretty_unit(unit: str) -> str:
    """Return ``N*m/rad^2`` as N·m/rad²."""
    return unit.replace("*", "·").translate(str.maketrans("23456789", "²³⁴⁵⁶⁷⁸⁹")).replace("^", "")


def _escaped(text: str) -> str:
    """Return user text as rich shows it literally."""
    from rich.markup import escape

    return escape(text)
