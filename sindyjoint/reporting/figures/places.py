"""Where the gap lies."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING

from matplotlib.axes import Axes

from sindyjoint.reporting.style import PALETTE, plain, shortened

if TYPE_CHECKING:
    from sindyjoint.diagnosis.result import Diagnosis


def where(result: Diagnosis, ax: Axes) -> Axes:
    """Draw the regions that hold more of the gap than their share of the samples."""
    places = list(result.where)
    ax.barh(range(len(places)), [100 * place.share for place in places], height=0.6, color=PALETTE[0])
    labels = [plain(fill(shortened(place.words.partition(":")[0], 60), 26)) for place in places]
    ax.set_yticks(range(len(places)), labels)
    ax.invert_yaxis()
    ax.set_xlim(0, 100)
    ax.set_xlabel("share of the mean square gap (%)")
    ax.set_title("Where the gap lies")
    return ax
