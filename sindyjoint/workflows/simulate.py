"""What is simulated: runs of a joint whose law is known, and a rig in motion."""

import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from sindyjoint.described import Described, Shown, same
from sindyjoint.equation.catalogue_file import as_model
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.model_parts import range_warnings
from sindyjoint.errors import InputError, checks_options
from sindyjoint.files import write_campaign
from sindyjoint.inputs import constant
from sindyjoint.mechanics import Law
from sindyjoint.mechanics.rigs import PLACEHOLDERS, Rig, load_rig
from sindyjoint.mechanics.sensors import SENSOR_RIG
from sindyjoint.mechanics.transient import Response
from sindyjoint.mechanics.virtual import campaign_joint, named_joint, plan_options, run_tests, virtual_test
from sindyjoint.mechanics.virtual_rig import hinges
from sindyjoint.numeric import RNG, Array
from sindyjoint.planning.plan import play, read_plan
from sindyjoint.record import Campaign
from sindyjoint.response.laws import model_law
from sindyjoint.response.verify_rig import joint_range_warnings, place_by_name


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


class MadeTest(NamedTuple):
    """A virtual test that is not written yet.

    Parameters
    ----------
    campaign : Campaign
    channels : list of dict of str to ndarray, or None
        Of each run those of strain gauges and laser spots, where they were asked for.
    notes : tuple of str
        What the model knows of its rig, and where the runs leave what it was tested to.
    """

    campaign: Campaign
    channels: list[dict[str, Array]] | None
    notes: tuple[str, ...]

    def write(self, out: Path, format: str, force: bool) -> Path:
        """Write manifest and run files, and return where the manifest is."""
        sensors = SENSOR_RIG if self.channels else None
        return write_campaign(self.campaign, out, format, sensors, self.channels, force=force)


def make_test(
    joint: str | Law,
    model: JointModel | str | Path | None = None,
    at: Mapping[str, float] | None = None,
    *,
    plan: str | os.PathLike[str] | None = None,
    rng: RNG = 0,
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> MadeTest:
    """Make a virtual test; parameters are those of :func:`simulate`, which writes it, too."""
    say = progress or (lambda stage: None)
    known, notes = None if model is None else as_model(model), []
    if known is None and at:
        raise InputError("inputs are given (at) without a model; the paper's joints have none")
    if known is not None:
        held = known.at(**(at or {}))
        joint, options = model_law(held), {"angle_limit": known.fitted.angle, **options}
        lag = 0.0 if known.test is None else known.test.total("time shift")
        if lag and "skew" not in options:
            options["skew"] = lag
            notes.append(f"the moment lags by {lag:.3g} s, as the model knows of its rig (skew = 0: not)")
    channels = None
    if plan is not None:
        planned, sensors = read_plan(Path(plan))
        say(f"simulating {len(planned)} runs")
        campaign = play(named_joint(joint), planned, sensors, rng)
    else:
        test = virtual_test(joint, **options)
        say(f"simulating {len(test.frequencies) * len(test.levels)} runs")
        made = run_tests(test, np.random.default_rng(rng))
        campaign = Campaign(campaign_joint(test), tuple(run for run, _ in made), simulated=True)
        channels = [raw for _, raw in made] if test.raw else None
    if known is not None:
        campaign = _of_model(campaign, held)
        for run in campaign.runs:
            rate = np.gradient(run.angle, 1 / run.sample_rate)
            notes += range_warnings(known.fitted, known.joint.motion, run.angle, rate, run.name)
    return MadeTest(campaign, channels, tuple(notes))


def _of_model(campaign: Campaign, model: JointModel) -> Campaign:
    """Return a simulated campaign as one of a model's joint, its inputs at their reference."""
    runs = tuple(
        replace(run, inputs={each.name: constant(each.reference, run.n_samples) for each in model.inputs})
        for run in campaign.runs
    )
    joint = replace(model.joint, inertia=model.inertia)
    return Campaign(joint, runs, simulated=True, inputs=model.inputs)


@checks_options(plan_options)
def simulate(
    joint: str | Law = "inter-panel",
    *,
    model: JointModel | str | Path | None = None,
    at: Mapping[str, float] | None = None,
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
    model : JointModel or path-like, optional
        The joint to test instead. Levels are then fractions of the largest angle that it was fitted to.
    at : mapping of str to float, optional
        Values of its inputs, SI; those not given are at their reference.
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

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, rng=0)
    >>> [run.name for run in test.runs]
    ['3Hz-0.9', '3Hz-0.5', '5Hz-0.9', '5Hz-0.5']
    """
    if plan is not None and options:
        raise InputError(f"a plan and {', '.join(options)} were given; expected one of them: edit the plan")
    made = make_test(joint, model, at, plan=plan, rng=rng, **options)
    for note in made.notes:
        warnings.warn(note, UserWarning, stacklevel=2)
    if out is not None:
        made.write(Path(out), format, force)
    return made.campaign


@dataclass(frozen=True)
class PointMotion:
    """Motion of a point of a structure.

    Parameters
    ----------
    name : str
    peak : float
        Largest displacement, m.
    """

    name: str
    peak: float


@dataclass(frozen=True)
class JointMotion:
    """Motion of a joint of a structure.

    Parameters
    ----------
    name : str
    peak_angle : float
        rad.
    locked_share : float
        Share of the time in which it sticks.
    last_slip : float
        s; zero for one that never slips.
    dissipated : float
        J.
    """

    name: str
    peak_angle: float
    locked_share: float
    last_slip: float
    dissipated: float


@dataclass(frozen=True, eq=False, repr=False)
class RigMotion(Shown):
    """The result of :func:`rig_motion`.

    Parameters
    ----------
    rig : Rig
    slipping, locked : ndarray, shape (modes,)
        Natural frequencies with the joints' tangent stiffness at standstill, and with locked joints, Hz.
    response : Response
    warnings : tuple of str
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {
        "rig": "rig.name",
        "frequencies": same("slipping", "locked"),
        **same("duration", "points", "joints"),
        "beams_dissipated": "response.beam_dissipation",
        "warnings": "warnings",
    }
    rig: Rig
    slipping: Array
    locked: Array
    response: Response
    warnings: tuple[str, ...] = ()

    @property
    def heat(self) -> dict[str, float]:
        """Energy dissipated in each joint and in the beams, J."""
        response = self.response
        joints = dict(zip(response.joints, response.joint_dissipation.tolist(), strict=True))
        return {**joints, "beams": response.beam_dissipation}

    @property
    def last_slips(self) -> Array:
        """Time at which each joint slips for the last time, s; zero for one that never does."""
        return np.array([self.response.time[moving].max(initial=0.0) for moving in ~self.response.stuck])

    @property
    def duration(self) -> float:
        """Simulated time, s."""
        return float(self.response.time[-1])

    @property
    def points(self) -> tuple[PointMotion, ...]:
        """The points of the structure."""
        return tuple(
            PointMotion(name, float(np.abs(values).max()))
            for name, values in self.response.displacement.items()
        )

    @property
    def joints(self) -> tuple[JointMotion, ...]:
        """The joints of the structure."""
        response = self.response
        columns = (
            np.abs(response.angle).max(axis=1),
            response.stuck.mean(axis=1),
            self.last_slips,
            response.joint_dissipation,
        )
        return tuple(map(JointMotion, response.joints, *(column.tolist() for column in columns)))


def rig_motion(
    rig: Rig | str | Path,
    model: JointModel | str | Path | None = None,
    *,
    progress: Callable[[str], None] | None = None,
) -> RigMotion:
    """Simulate a rig under the pulse that its file describes.

    Parameters
    ----------
    rig : Rig, str or Path
        The name of a shipped rig, or a TOML file.
    model : JointModel, str or Path, optional
        Replaces the joints that bear its name, or that the rig gives as ``law = "model"``.
    progress : callable, optional

    Returns
    -------
    RigMotion

    Raises
    ------
    InputError
        For a rig or a model that cannot be read, or a rig that needs a model where none is given.
    SimulationError
        When a joint passes its softening limit; carries the time.

    Examples
    --------
    >>> motion = rig_motion("pulse-rig")
    >>> bool(motion.slipping[0] < motion.locked[0])
    True
    """
    say = progress or (lambda stage: None)
    say("reading the rig")
    made = rig if isinstance(rig, Rig) else load_rig(rig, PLACEHOLDERS)
    known = None if model is None else as_model(model)
    made, standing = place_by_name(made, [] if known is None else [known])
    say("frequencies")
    structure = made.structure()
    slipping, locked = structure.frequencies(4), structure.frequencies(4, locked=True)
    say(f"simulating {made.duration:g} s")
    response = made.respond()
    modelled = {h.name for h, stands in zip(hinges(made), standing, strict=True) if stands is not None}
    warnings = () if known is None else tuple(joint_range_warnings(known, response, modelled))
    return RigMotion(made, slipping, locked, response, warnings)
