"""Models in the place of joints of rigs and structures, and one against a rig's response to a pulse."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.equation.model_parts import range_warnings
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.mechanics.laws import Law, PaperLaw
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.mechanics.rig_test_file import UNKNOWN
from sindyjoint.mechanics.rigs import Rig
from sindyjoint.mechanics.structure import Structure
from sindyjoint.mechanics.virtual_rig import PulseTest, hinges, virtual_pulse_test, with_laws
from sindyjoint.numeric import Array, main_frequency, noise_by_differences, rms
from sindyjoint.response.laws import model_law
from sindyjoint.response.oscillations import (
    Oscillation,
    compare_oscillations,
    oscillation,
)
from sindyjoint.response.verification import Band, RunVerification, Settings, Verification, band_of, judged

# Placeholder in a rig for the joints whose law is "model", or sought, until a model replaces it.
MODEL_PLACEHOLDER = PaperLaw(k1=1.0, name="model")
PLACEHOLDERS = {"model": MODEL_PLACEHOLDER, "unknown": MODEL_PLACEHOLDER}


def verify_rig(
    model: JointModel,
    rig: Rig,
    settings: Settings,
    truth: dict[str, float],
    say: Callable[[str], None],
) -> Verification:
    """Compare the rig's measured response, or a virtual pulse test, with the model's simulation."""
    if model.joint.motion != "rotation":
        raise InputError("the model is of a joint in translation; the joints of a rig rotate")
    modelled = find_model_joints(rig, model)
    say("the measured response")
    test = _provide_pulse_test(rig, truth, settings.generator)
    warnings = []
    if test.simulated:
        beyond = f"; it holds {test.truth}, which the simulation does not know" if test.truth else ""
        warnings.append(f"the response is simulated (a virtual pulse test of the rig), not measured{beyond}")
    duration = test.displacement.size / test.sample_rate
    options = {"points": (test.point,), "duration": duration, "sample_rate": test.sample_rate}

    def response(law: Law) -> Any:
        return with_laws(rig, lambda hinge: law if hinge.name in modelled else hinge.law).respond(**options)

    say("simulating the rig")
    failure, simulated = "", None
    try:
        simulated = response(model_law(model))
    except SimulationError as error:
        failure = str(error)
    n = test.displacement.size
    band = None
    if simulated is not None and settings.draws:
        say(f"simulating {settings.draws} sets of coefficients")
        band = band_of([_simulate_tip(response, draw, test.point, n) for draw in settings.drawn(model)])
    exceeded = [] if simulated is None else joint_range_warnings(model, simulated, modelled)
    compared = _compare_pulse(rig, test, simulated, band, failure)
    result = judged(model, "rig", rig.name, settings.tolerance, [compared], [*warnings, *exceeded])
    return replace(result, beyond_range=tuple(line.partition(":")[0] for line in exceeded))


def joint_range_warnings(
    model: JointModel, response: Any, modelled: Collection[str], whose: str = ""
) -> list[str]:
    """Return what to say of joints of a rig that move beyond what their model, ``whose`` it is, was tested to."""
    lines: list[str] = []
    for name, angle, rate in zip(response.joints, response.angle, response.rate, strict=True):
        if name in modelled:
            lines += range_warnings(model.fitted, model.joint.motion, angle, rate, whose + name)
    return lines


def _simulate_tip(response: Callable[[Law], Any], draw: JointModel, point: str, n: int) -> Array | None:
    try:
        return response(model_law(draw)).displacement[point][:n]
    except SimulationError:
        return None


@dataclass(frozen=True, eq=False)
class PlacedModels:
    """A rig whose joints have their laws, and the model of each joint where it has one."""

    rig: Rig
    models: tuple[JointModel | None, ...]

    @property
    def tested(self) -> Array:
        """Tested angle of each joint, rad; infinite without a model."""
        return np.array([np.inf if m is None else m.fitted.angle for m in self.models])

    @classmethod
    def in_rig(cls, rig: Rig, models: Sequence[JointModel]) -> PlacedModels:
        """Put models in the place of the joints of a rig that they stand for; none may be left without a law.

        Raises
        ------
        InputError
        """
        standing: dict[str, JointModel] = {}
        for model in models:
            if model.joint.motion != "rotation":
                raise InputError("the model is of a joint in translation; the joints of a rig rotate")
            for name in find_model_joints(rig, model):
                if name in standing:
                    raise InputError(
                        f"two models stand for joint {name!r} of the rig {rig.name!r}; expected one"
                    )
                standing[name] = model
        left = [h.name for h in hinges(rig) if h.law is MODEL_PLACEHOLDER and h.name not in standing]
        if left:
            raise InputError(
                f"the rig {rig.name!r} has a joint whose law is 'model', and no model was given; give --model "
                f"(joint {left[0]})"
            )
        laws = {id(model): model_law(model) for model in models}
        placed = with_laws(
            rig, lambda hinge: laws[id(standing[hinge.name])] if hinge.name in standing else hinge.law
        )
        return cls(placed, tuple(standing.get(hinge.name) for hinge in hinges(rig)))


def find_model_joints(rig: Rig, model: JointModel) -> set[str]:
    """Return the names of the joints that the model stands for.

    Those whose law is "model" in the rig; else those whose law has the name of the model's joint; else the only one.
    """
    joints = hinges(rig)
    if not joints:
        raise InputError(f"the rig {rig.name!r} has no joint for the model to stand for")
    marked = {hinge.name for hinge in joints if hinge.law is MODEL_PLACEHOLDER}
    alike = {hinge.name for hinge in joints if getattr(hinge.law, "name", None) == model.joint.name}
    if marked or alike:
        return marked or alike
    if len(joints) == 1:
        return {joints[0].name}
    raise InputError(
        f'the rig {rig.name!r} has {len(joints)} joints, none of them a {model.joint.name!r}; write law = "model" '
        "for those that the model stands for"
    )


def _provide_pulse_test(rig: Rig, truth: dict[str, float], generator: np.random.Generator) -> PulseTest:
    measured = rig.measured
    if measured is not None:
        if truth:
            raise InputError(
                f"{', '.join(truth)}: belong(s) to a virtual pulse test; the rig {rig.name!r} names a measured response"
            )
        return PulseTest(measured.point, measured.displacement, measured.sample_rate)
    if any(hinge.law is MODEL_PLACEHOLDER for hinge in hinges(rig)):
        raise InputError(
            f"the rig {rig.name!r} has a joint whose law is 'model' and no measured response: a virtual test needs the "
            "true law; add a [measured] table, or name a shipped joint as the law"
        )
    return virtual_pulse_test(rig, rng=generator, **truth)


def _compare_pulse(
    rig: Rig, test: PulseTest, response: Any, band: Band | None, failure: str
) -> RunVerification:
    measured = test.displacement
    scale = float(np.std(measured))
    simulated = None if response is None else response.displacement[test.point][: measured.size]
    frequency = main_frequency(measured, test.sample_rate)
    oscillations = (
        oscillation(measured, test.sample_rate, frequency),
        None if simulated is None else oscillation(simulated, test.sample_rate, frequency),
    )
    gap = compare_oscillations(*oscillations)
    return RunVerification(
        name=f"pulse at {rig.at}",
        channel="displacement",
        drive="pulse",
        time=test.time,
        measured=measured,
        simulated=simulated,
        band=band,
        response_nrmse=None if simulated is None else rms(simulated - measured) / scale,
        moment_nrmse=None,
        noise_floor=noise_by_differences(measured, 4) / scale,
        amplitude_rms_error=None if gap is None else gap.amplitude_rms_error,
        mean_period_difference=None if gap is None else gap.mean_period_difference,
        oscillations=oscillations,
        energy=None if response is None else _energy_per_cycle(oscillations, response),
        failure=failure,
        rmse=None if simulated is None else rms(simulated - measured),
        rmse_unit="m",
    )


def _energy_per_cycle(
    oscillations: tuple[Oscillation | None, Oscillation | None], response: Any
) -> Array | None:
    """Energy lost from one half-cycle to the next but one, J, shape (2, cycles).

    The simulated energy is known; the measured one is taken in proportion to the square of the amplitude.
    """
    measured, simulated = oscillations
    if measured is None or simulated is None:
        return None
    n = min(measured.amplitude.size, simulated.amplitude.size)
    if n < 3:
        return None
    at = np.interp(simulated.amplitude_time[:n], response.time, response.energy)
    energies = np.array([at * ((measured.amplitude[:n] / simulated.amplitude[:n]) ** 2), at])
    return energies[:, :-2:2] - energies[:, 2::2]


def place_by_kind(
    test: RigTest, models: Sequence[JointModel]
) -> tuple[Structure, tuple[JointModel | None, ...]]:
    """Return a structure whose joints have their laws, and the model of each joint where it has one.

    A model stands for the joints whose kind has its name; a single one also for those without a law, if these are of
    one kind.

    Raises
    ------
    InputError
        For a model that fits no joint, two for one kind, or a joint that is left without a law.
    """
    standing: dict[str, JointModel] = {}
    for model in models:
        kind = _kind_of(test, model, len(models) == 1)
        if kind in standing:
            raise InputError(f"two models stand for {kind!r} of {test.name!r}; expected one")
        if model.joint.motion != test.motion:
            raise InputError(
                f"the model {model.joint.name!r} is of a joint in {model.joint.motion}; those of {test.name!r} are in "
                f"{test.motion}"
            )
        standing[kind] = model
    hinges = test.structure.hinges
    left = [
        kind
        for kind, hinge in zip(test.kinds, hinges, strict=True)
        if hinge.law is UNKNOWN and kind not in standing
    ]
    if left:
        raise InputError(
            f"{test.name!r} has joints without a law ({', '.join(dict.fromkeys(left))}); give --model: what discover "
            "wrote of it, or a model.json"
        )
    laws = {kind: model_law(model) for kind, model in standing.items()}
    placed = tuple(
        replace(hinge, law=laws.get(kind, hinge.law)) for kind, hinge in zip(test.kinds, hinges, strict=True)
    )
    return replace(test.structure, hinges=placed), tuple(standing.get(kind) for kind in test.kinds)


def _kind_of(test: RigTest, model: JointModel, alone: bool) -> str:
    name = model.joint.name
    if name in test.kinds:
        return name
    without = dict.fromkeys(
        kind for kind, hinge in zip(test.kinds, test.structure.hinges, strict=True) if hinge.law is UNKNOWN
    )
    if alone and len(without) == 1:
        return next(iter(without))
    raise InputError(
        f"{test.name!r} has no joint of kind {name!r}, after which the model is named; it has "
        f"{', '.join(dict.fromkeys(test.kinds))}: write kind = {name!r} for those that it stands for"
    )
