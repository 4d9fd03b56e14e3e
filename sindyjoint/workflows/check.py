"""Are the data of a campaign or of a structure sound: what stands against a model of them, before any is made."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from sindyjoint.clock import single_threaded
from sindyjoint.errors import checks_options
from sindyjoint.files.campaign import LONGEST, load_campaign
from sindyjoint.mechanics.rig_file import is_rig_test
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.numeric import RNG
from sindyjoint.record import Campaign
from sindyjoint.soundness.check import Check, check_accepted, check_data


@checks_options()
@single_threaded()
def check(
    campaign: Campaign | RigTest | str | Path | Any = None,
    accept: Sequence[str] = (),
    *,
    rng: RNG = None,
    progress: Callable[[str], None] | None = None,
) -> Check[Any]:
    """Check whether the data of a campaign, or of a structure's test, are sound.

    Parameters
    ----------
    campaign : Campaign, RigTest, path of a campaign.toml or of a rig.toml or of the folder with it, or None
        ``None``: the built-in virtual test of the inter-panel joint, which is simulated. Of runs that are too long for
        memory the first segment is checked.
    accept : sequence of str
        Ids of findings that shall not stop the work.
    rng : int, Generator or None
        Of the virtual test.
    progress : callable, optional
        Called with the name of each stage.

    Returns
    -------
    Check
        With ``soundness`` (verdict and findings) and ``usable``, the campaign without the samples that are left out (of
        a structure, with these filled in).

    Raises
    ------
    InputError
        For data that cannot be read.
    UnknownNameError
        For an id that no finding has.

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, rng=0)
    >>> sindyjoint.check(test).soundness.verdict
    'sound'
    """
    say = progress or (lambda stage: None)
    check_accepted(accept)
    if isinstance(campaign, str | Path) and is_rig_test(campaign):
        from sindyjoint.mechanics.rig_test_file import load_rig_test

        campaign = load_rig_test(campaign)
    opened = campaign if isinstance(campaign, RigTest) else the_campaign(campaign, rng, LONGEST)
    say("checking the data")
    return check_data(opened, accept)


def the_campaign(
    campaign: Campaign | str | Path | Any, rng: RNG = None, longest: int | None = None
) -> Campaign:
    """Return a campaign from itself, a file, data frames, or the built-in virtual test.

    Of runs in files that are longer than ``longest`` only a segment is read.
    """
    if isinstance(campaign, Campaign):
        return campaign
    if campaign is None:
        from sindyjoint.mechanics.virtual import virtual_campaign

        return virtual_campaign("inter-panel", noise=0.01, rng=0 if rng is None else rng)

    if isinstance(campaign, str | Path):
        return load_campaign(campaign, longest)
    return Campaign.from_frames(campaign)
