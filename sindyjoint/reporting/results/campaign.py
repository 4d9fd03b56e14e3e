"""A campaign: what its runs hold; its picture and its page are those of its check."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.record import Campaign
from sindyjoint.reporting.style import pretty_unit
from sindyjoint.reporting.text_table import DASH, TextTable, aligned, terminal_table
from sindyjoint.reporting.view import View
from sindyjoint.text import quantities

if TYPE_CHECKING:
    from rich.console import Console


class CampaignView(View[Campaign, None]):
    """A campaign."""

    results = (Campaign,)

    def tables(self, result: Campaign) -> tuple[TextTable, ...]:
        """Return the runs."""
        q = quantities(result.joint.motion)
        angle, moment = q.angle_unit, pretty_unit(q.moment_unit)
        rows = tuple(
            (
                run.name,
                str(run.n_samples),
                f"{run.sample_rate:g} {f'/{angle} of path' if run.quasi_static else 'Hz'}",
                DASH if run.frequency is None else f"{run.frequency:g} Hz",
                f"{np.abs(run.angle).max():.3e} {angle}",
                f"{np.abs(run.moment).max():.3g} {moment}",
            )
            for run in result.runs
        )
        columns = ("run", "samples", "rate", "frequency", "largest motion", f"largest {q.moment.lower()}")
        return (TextTable("runs", "Runs", columns, rows),)

    def records(self, result: Campaign) -> list[dict[str, Any]]:
        """Return the runs, numbers in SI units."""
        return [
            {
                "run": run.name,
                "samples": run.n_samples,
                "sample_rate": run.sample_rate,
                "frequency": np.nan if run.frequency is None else run.frequency,
                "level": run.level,
                "use": run.use,
                "largest_angle": float(np.abs(run.angle).max()),
                "largest_moment": float(np.abs(run.moment).max()),
            }
            for run in result.runs
        ]

    def about(self, result: Campaign) -> str:
        """Return the joint, and how many runs there are."""
        from rich.markup import escape

        virtual = " (simulated)" if result.simulated else ""
        return f"{escape(result.joint.name)}{virtual}: {len(result.runs)} run(s)"

    def show_result(self, result: Campaign, console: Console) -> None:
        """Print a line per run."""
        (runs,) = self.tables(result)
        console.print(terminal_table(runs.columns, runs.rows, "lr"))

    def details(self, result: Campaign) -> Iterator[str]:
        """Yield a line per run."""
        (runs,) = self.tables(result)
        yield from aligned((runs.columns, *runs.rows))
