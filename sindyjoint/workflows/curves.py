"""Curves that a designer works with: of a joint over amplitude, of a structure over frequency and amplitude."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sindyjoint.clock import single_threaded
from sindyjoint.equation.catalogue_file import as_model, read_models
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, checks_options, refuse
from sindyjoint.mechanics import Law
from sindyjoint.mechanics.rig_file import rig_path, shipped_rigs
from sindyjoint.mechanics.rig_test import BASE, RigTest
from sindyjoint.mechanics.rig_test_file import has_pulse, load_rig_structure
from sindyjoint.mechanics.rigs import PLACEHOLDERS, Rig, load_rig
from sindyjoint.mechanics.structure import Structure
from sindyjoint.numeric import Array
from sindyjoint.record import Motion
from sindyjoint.response.laws import model_law
from sindyjoint.response.verify_rig import place_by_kind, place_by_name
from sindyjoint.substructure.continuation import FOLLOWED
from sindyjoint.substructure.forced import ForcedResponse, StructureCurves, frequency_response
from sindyjoint.substructure.harmonic_balance import Balance
from sindyjoint.substructure.joint_curves import JointCurves, Varied, model_curve
from sindyjoint.substructure.modes import ModeCurve, mode_over_amplitude, point_of_mode

Say = Callable[[str], None]
Model = JointModel | str | Path

# Amplitudes of a joint: from this share of the tested angle to this multiple of it, so many.
FROM, BEYOND, AMPLITUDES = 0.02, 1.5, 40
# Curves end at this share of a joint's softening limit; where it has none and was not tested, at this angle, rad.
TO_SOFTENING, WIDEST = 0.95, 0.01


@checks_options()
@single_threaded()
def curves(
    subject: JointModel | Rig | RigTest | str | Path,
    *,
    model: Model | Sequence[Model] = (),
    frequencies: Sequence[float] = (),
    amplitudes: tuple[float, float] | None = None,
    levels: Sequence[float] = (),
    band: tuple[float, float] | None = None,
    modes: int = 2,
    at: str | None = None,
    point: str | None = None,
    harmonics: int | None = None,
    progress: Say | None = None,
) -> JointCurves | StructureCurves:
    """Return a joint's stiffness, loss and energy over amplitude; or a structure's frequency response and modes.

    Parameters
    ----------
    subject : JointModel, Rig, RigTest, str or Path
        A model, its ``model.json`` or the folder with it; or a rig, its TOML file or the name of a shipped one.
    model : JointModel or path, or several of them
        Of a rig: replace the joints that bear their names, or that the rig gives as ``law = "model"``; of a rig with
        sensors and runs those of their kind. A folder that ``discover RIG`` wrote holds those of all kinds. Curves
        have 95 % bands from their covariance.
    frequencies : sequence of float
        Of a joint: Hz. Default: lowest and highest that the model was fitted to; 1 Hz where it knows none.
    amplitudes : (float, float), optional
        Of a joint: rad (m). Default: from 0.02 to 1.5 of the largest tested, below the softening limit.
    levels : sequence of float
        Of a rig: amplitudes of the force, N. Default: three, from where joints begin to slip in resonance to where
        one comes near its softening limit, or to 1.5 of the angle that its model was tested to.
    band : (float, float), optional
        Of a rig: Hz. Default: around its first mode.
    modes : int
        Of a rig: how many modes are followed over amplitude.
    at, point : str, optional
        Of a rig: where the force acts, and whose deflection the response is. Default: as the rig says; its first
        output point, or where the force acts.
    harmonics : int
        Of a rig: that are balanced. Default: at each point of a curve as many as it needs.
    progress : callable, optional
        Called with the name of each stage.

    Returns
    -------
    JointCurves or StructureCurves

    Raises
    ------
    InputError
        For a model or rig that cannot be read, and options that do not belong to it.
    SimulationError
        Where no periodic response is found.

    Examples
    --------
    >>> found = curves("pulse-rig", levels=[0.4], modes=1)
    >>> bool(found.modes[0].damping.max() > 0.03)
    True
    """
    say = progress or (lambda stage: None)
    if isinstance(subject, JointModel) or (isinstance(subject, str | Path) and _names_model(subject)):
        given = {"model": model, "levels": levels, "band": band, "at": at, "point": point}
        _refuse(given, "a rig", "a model")
        return _of_joint(as_model(subject), frequencies, amplitudes, say)
    given = {"frequencies": frequencies, "amplitudes": amplitudes}
    _refuse(given, "a model", "a rig")
    given_models = [model] if isinstance(model, JointModel | str | Path) else list(model)
    models = [
        one
        for each in given_models
        for one in ([each] if isinstance(each, JointModel) else read_models(each))
    ]
    if isinstance(subject, RigTest) or (not isinstance(subject, Rig) and not has_pulse(subject)):
        placed = _in_test(subject, models)
    else:
        placed = _in_rig(subject, models)
    if at is None and placed.at == BASE:
        raise InputError(f"the base of {placed.name!r} is shaken; give at, the point where a force acts")
    placed = replace(
        placed, at=at or placed.at, point=point or at or placed.point, harmonics=harmonics, say=say
    )
    return placed.curves(levels, band, modes)


def _names_model(subject: str | Path) -> bool:
    if str(subject) in shipped_rigs():
        return False
    path = Path(subject)
    return (path.is_dir() and rig_path(path) == path) or path.suffix.lower() == ".json"


@dataclass(frozen=True, eq=False)
class _Placed:
    """A structure whose joints have their laws, the model of each joint that has one, and where it is driven."""

    name: str
    motion: Motion
    structure: Structure
    models: tuple[JointModel | None, ...]
    at: str
    point: str
    harmonics: int | None = None
    say: Say = lambda stage: None

    @property
    def tested(self) -> Array:
        """Tested angle of each joint, rad (m); infinite without a model."""
        return np.array([np.inf if m is None else m.fitted.angle for m in self.models])

    def curves(
        self, levels: Sequence[float], band: tuple[float, float] | None, modes: int
    ) -> StructureCurves:
        """Return the curves; see :func:`curves`."""
        fewest = min(modes, 1 if self.harmonics is None else self.harmonics)
        positive = all(0 < level < np.inf for level in levels)
        refuse(
            [
                (fewest < 1, f"modes = {modes}, harmonics = {self.harmonics}; expected at least one of each"),
                (not positive, f"levels are {list(levels)}; expected positive forces"),
            ]
        )
        structure = self.structure
        sliding, locked = structure.frequencies(modes), structure.frequencies(modes, locked=True)
        if band is None:
            # Around the first frequencies with sliding and with locked joints.
            band = (0.8 * float(sliding[0]), 1.15 * float(locked[0]))
        if not 0 < band[0] < band[1] < np.inf:
            raise InputError(f"band is {band}; expected two positive frequencies, the lower one first")
        laws, warnings = [hinge.law for hinge in structure.hinges], list[str]()
        varied, ends = Varied.of(laws, self.models), np.array([_softens(law) for law in laws])
        # Of each joint the angle at which modes end, rad (m).
        limits = np.minimum(TO_SOFTENING * ends, BEYOND * self.tested)
        limits = np.where(np.isfinite(limits), limits, WIDEST)
        followed = [self._mode(structure, number, limits, varied) for number in range(1, modes + 1)]
        balance = Balance.of(structure, self.at, self.point, harmonics=self.harmonics or FOLLOWED)
        responses = []
        for level in levels or self._levels(followed[0]):
            self.say(f"frequency response at {level:g} N")
            found = frequency_response(
                balance,
                level,
                band,
                refine=self.harmonics is None,
                varied=varied,
                tested=self.tested,
                limits=ends,
            )
            warnings += [line for line in self._warnings(found, ends) if line not in warnings]
            responses.append(found)
        return StructureCurves(
            self.name, self.at, self.point, tuple(h.name for h in structure.hinges), self.tested,
            sliding, locked, tuple(followed), tuple(responses),
            max(each.harmonics for each in followed + responses), True, tuple(warnings),
            self.motion,
        )  # fmt: skip

    def _mode(self, structure: Structure, number: int, limits: Array, varied: Varied | None) -> ModeCurve:
        """Follow a mode by the driven point, or by the one that it moves most where that is near a node."""
        self.say(f"mode {number} over amplitude")
        point = point_of_mode(structure, number, self.at)
        balance = Balance.of(structure, point, harmonics=self.harmonics or FOLLOWED, mode=number)
        return mode_over_amplitude(
            balance,
            number,
            point,
            limits,
            refine=self.harmonics is None,
            varied=varied,
            tested=self.tested,
        )

    def _levels(self, mode: ModeCurve) -> list[float]:
        """Return forces that hold the first mode where joints begin to slip, on the way, and near its end."""
        last = mode.amplitude[-1]
        first = mode.amplitude[0]
        slips = mode.slips[np.isfinite(mode.slips)]
        if slips.size and slips.min() > 0:
            first = 1.5 * float(slips.min())
        forces = np.interp((first, np.sqrt(first * last), 0.85 * last), mode.amplitude, mode.force)
        return [float(f"{force:.1e}") for force in forces]

    def _warnings(self, found: ForcedResponse, ends: Array) -> list[str]:
        warnings = []
        unit = "rad" if self.motion == "rotation" else "m"
        peaks = found.angle.max(axis=1)
        for hinge, peak, end, tested in zip(self.structure.hinges, peaks, ends, self.tested, strict=True):
            if peak > end:
                warnings.append(
                    f"at {found.force:g} N {hinge.name} passes its softening limit at {found.frequency[-1]:.4g} Hz, "
                    "where the curve ends; lower the force"
                )
            elif peak > tested:
                warnings.append(
                    f"at {found.force:g} N {hinge.name} moves up to {peak:.3g} {unit} where {tested:.3g} {unit} was "
                    "tested"
                )
        return warnings


def _in_rig(rig: Rig | str | Path, models: Sequence[JointModel]) -> _Placed:
    given = rig if isinstance(rig, Rig) else load_rig(rig_path(rig), PLACEHOLDERS)
    made, standing = place_by_name(given, models)
    return _Placed(made.name, "rotation", made.structure(), standing, made.at, made.points[0])


def _in_test(rig: RigTest | str | Path, models: Sequence[JointModel]) -> _Placed:
    test = rig if isinstance(rig, RigTest) else load_rig_structure(rig)
    structure, standing = place_by_kind(test, models)
    if len(structure.mass) == structure.n_joints:
        raise InputError(f"{test.name!r} has nothing beside its joints; its curves are a model's: give that")
    return _Placed(test.name, test.motion, structure, standing, test.at, test.at)


def _refuse(given: Mapping[str, object], owner: str, subject: str) -> None:
    words = f"was given, which belongs to the curves of {owner}; these are of {subject}"
    refuse((value, f"{name} {words}") for name, value in given.items())


def _of_joint(
    model: JointModel, frequencies: Sequence[float], amplitudes: tuple[float, float] | None, say: Say
) -> JointCurves:
    fitted = model.fitted
    law = model_law(model)
    if amplitudes is None:
        if not fitted.angle > 0:
            raise InputError("the model does not say up to which angle it was tested; give amplitudes")
        amplitudes = (FROM * fitted.angle, min(BEYOND * fitted.angle, TO_SOFTENING * _softens(law)))
    known = (min(fitted.frequencies), max(fitted.frequencies)) if fitted.frequencies else (1.0,)
    chosen = sorted(set(frequencies or known))
    ascending = 0 < amplitudes[0] < amplitudes[1] < np.inf
    refuse(
        [
            (
                not ascending,
                f"amplitudes are {amplitudes}; expected two positive numbers, the smaller one first",
            ),
            (
                not all(0 < frequency < np.inf for frequency in chosen),
                f"frequencies are {list(frequencies)}; expected positive numbers",
            ),
        ]
    )
    sizes = np.geomspace(*amplitudes, AMPLITUDES)
    found = []
    for frequency in chosen:
        say(f"loops at {frequency:g} Hz")
        found.append(model_curve(model, sizes, frequency))
    bare = "the model holds no standard errors: the curves have no bands"
    warnings = [bare] * (not np.any(model.number_errors > 0))
    inputs = ", ".join(each.name for each in model.inputs)
    warnings += [f"at the reference of {inputs}"] * bool(inputs)
    return JointCurves(
        model.joint.name, model.joint.motion, model.equation(), fitted.angle, fitted.rate, tuple(found),
        fitted.simulated, tuple(warnings),
    )  # fmt: skip


def _softens(law: Law) -> float:
    low, high = law.softening_limit
    return min(-low, high)
