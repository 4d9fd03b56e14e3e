"""A virtual test: runs of a joint whose law is known."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from sindyjoint.described import Described
from sindyjoint.errors import InputError, checks_options
from sindyjoint.numeric import RNG

if TYPE_CHECKING:
    from sindyjoint.mechanics.laws import Law
    from sindyjoint.record import Campaign


@dataclass(frozen=True)
class WrittenRun:
    """A simulated run.

    Parameters
    ----------
    name : str
    frequency : float or None
        Hz.
    level : str or None
    samples : int
    """

    name: str
    frequency: float | None
    level: str | None
    samples: int


@dataclass(frozen=True)
class WrittenTest(Described):
    """A virtual test that was written: what ``simulate --json`` prints.

    Parameters
    ----------
    manifest : Path
    joint : str
        Or structure.
    runs : tuple of WrittenRun
    """

    SCHEMA: ClassVar = 1
    manifest: Path
    joint: str
    runs: tuple[WrittenRun, ...]


def _options() -> tuple[str, ...]:
    from sindyjoint.mechanics.virtual import plan_options

    return plan_options()


@checks_options(_options)
def simulate(
    joint: str | Law = "inter-panel",
    *,
    plan: str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str] | None = None,
    format: str = "csv",
    rng: RNG = 0,
    force: bool = False,
    **options: Any,
) -> Campaign:
    """Simulate runs of a joint, with sensors and noise.

    Parameters
    ----------
    joint : {"inter-panel", "panel-root"} or Law
    plan : path-like, optional
        ``plan.toml``, or a folder with one: its runs, rate and noise are played, and no other options are taken.
    out : path-like, optional
        Folder to write ``campaign.toml`` and the run files to.
    format : {"csv", "tsv", "npz", "parquet", "h5", "mat"}
        Of the run files.
    rng : int, Generator or None
        Of the noise.
    force : bool
        Replace files of the same names that were not written so, or were changed since.
    **options
        ``frequencies``, ``levels``, ``noise``, ``duration`` ...; see
        :func:`~sindyjoint.mechanics.virtual.virtual_campaign`.

    Returns
    -------
    Campaign
        Marked as simulated, as are the files.

    Raises
    ------
    InputError, UnknownNameError, SimulationError
        For a plan that cannot be simulated.
    OutputError
        When the folder cannot be written, or holds other files of these names.
    """
    from sindyjoint.files import write_campaign
    from sindyjoint.mechanics.virtual import named_joint, virtual_campaign
    from sindyjoint.planning.plan_file import play, read_plan

    if plan is None:
        campaign = virtual_campaign(joint, rng=rng, **options)
    elif options:
        raise InputError(f"a plan and {', '.join(options)} were given; expected one of them: edit the plan")
    else:
        listed = read_plan(Path(plan))
        campaign = play(named_joint(joint), listed.runs, listed.sensors, rng)
    if out is not None:
        write_campaign(campaign, out, format, force=force)
    return campaign
