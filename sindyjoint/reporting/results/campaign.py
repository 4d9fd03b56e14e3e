"""A campaign: what its runs hold."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sindyjoint.record import Campaign
from sindyjoint.reporting.style import pretty_unit
from sindyjoint.reporting.text_table import DASH, TextTable, aligned
from sindyjoint.reporting.view import View
from sindyjoint.text import quantities


class CampaignView(View[Campaign, None]):
    """A campaign, of which only the lines of ``--verbose`` are shown."""

    results = (Campaign,)

    def tables(self, result: Campaign) -> tuple[TextTable, ...]:
        """Return the runs."""
        q = quantities(result.joint.motion)
        angle, moment = q.angle_unit, pretty_unit(q.moment_unit)
        rows = tuple(
            (
                run.name,
                str(run.n_samples),
                f"{run.sample_rate:g} Hz",
                DASH if run.frequency is None else f"{run.frequency:g} Hz",
                f"{np.abs(run.angle).max():.3e} {angle}",
                f"{np.abs(run.moment).max():.3g} {moment}",
            )
            for run in result.runs
        )
        columns = ("run", "samples", "rate", "frequency", "largest motion", f"largest {q.moment.lower()}")
        return (TextTable("runs", "Runs", columns, rows),)

    def details(self, result: Campaign) -> Iterator[str]:
        """Yield a line per run."""
        (runs,) = self.tables(result)
        yield from aligned((runs.columns, *runs.rows))
