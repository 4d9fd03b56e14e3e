"""Are the data of a campaign sound: what stands against a model of them, before any is made."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from sindyjoint.discovery.large.segments import LONGEST
from sindyjoint.options import checks_options
from sindyjoint.record import Campaign
from sindyjoint.soundness.check import Check, check_accepted, check_campaign
from sindyjoint.threads import single_threaded
from sindyjoint.workflows.discover import the_campaign


@checks_options()
@single_threaded()
def check(
    campaign: Campaign | str | Path | None = None,
    accept: Sequence[str] = (),
    *,
    random_state: Any = None,
    progress: Callable[[str], None] | None = None,
) -> Check:
    """Check whether the data of a campaign are sound.

    Parameters
    ----------
    campaign : Campaign, path of a campaign.toml, or None
        ``None``: the built-in virtual test of the inter-panel joint, which is simulated. Of runs that are too long for
        memory the first segment is checked.
    accept : sequence of str
        Ids of findings that shall not stop the work.
    random_state : int, Generator or None
        Of the virtual test.
    progress : callable, optional
        Called with the name of each stage.

    Returns
    -------
    Check
        With ``soundness`` (verdict and findings) and ``usable``, the campaign without the samples that are left out.

    Raises
    ------
    InputError
        For data that cannot be read.
    UnknownNameError
        For an id that no finding has.
    """
    say = progress or (lambda stage: None)
    check_accepted(accept)
    opened = the_campaign(campaign, random_state, LONGEST)
    say("checking the data")
    return check_campaign(opened, accept)
