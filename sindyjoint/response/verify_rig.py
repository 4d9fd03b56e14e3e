"""Models in the place of joints of rigs and structures, and one against a rig's response to a pulse."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.equation.model_parts import range_warnings
from sindyjoint.errors import InputError
from sindyjoint.mechanics import Law
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.mechanics.rigs import UNKNOWN, MeasuredResponse, Rig
from sindyjoint.mechanics.structure import Structure
from sindyjoint.mechanics.virtual_rig import hinges, virtual_pulse_test, with_laws
from sindyjoint.numeric import Array, main_frequency, noise_by_differences, rms
from sindyjoint.response.laws import model_law
from sindyjoint.response.oscillations import (
    Oscillation,
    compare_oscillations,
    oscillation,
)
from sindyjoint.response.run import attempted
from sindyjoint.response.verification import Band, RunVerification, Settings, Verification, band_of, judged


def verify_rig(
    model: JointModel,
    rig: Rig,
    settings: Settings,
    truth: dict[str, float],
    say: Callable[[str], None],
) -> Verification:
    """Compare the rig's measured response, or a virtual pulse test, with the model's simulation."""
    modelled = set(_standing([model], rig.name, "rotation", lambda each: find_model_joints(rig, each)))
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
    simulated, failure = attempted(response, model_law(model))
    exceeded = [] if simulated is None else joint_range_warnings(model, simulated, modelled)
    if simulated is not None and settings.draws:
        say(f"simulating {settings.draws} sets of coefficients")
    draws = [] if simulated is None else settings.drawn(model)
    drawn = [attempted(response, model_law(draw))[0] for draw in draws]
    shown = slice(test.displacement.size)
    band = band_of([None if each is None else each.displacement[test.point][shown] for each in drawn])
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


def place_by_name(rig: Rig, models: Sequence[JointModel]) -> tuple[Rig, tuple[JointModel | None, ...]]:
    """Return a rig whose joints have their laws, and the model of each joint where it has one.

    Raises
    ------
    InputError
        As :func:`place_by_kind`.
    """
    standing = _standing(models, rig.name, "rotation", lambda model: find_model_joints(rig, model))
    left = [h.name for h in hinges(rig) if h.law is UNKNOWN and h.name not in standing]
    if left:
        raise InputError(
            f"the rig {rig.name!r} has a joint whose law is 'model', and no model was given; give --model "
            f"(joint {left[0]})"
        )
    laws = {name: model_law(model) for name, model in standing.items()}
    placed = with_laws(rig, lambda hinge: laws.get(hinge.name, hinge.law))
    return placed, tuple(standing.get(hinge.name) for hinge in hinges(rig))


def _standing(
    models: Sequence[JointModel], name: str, motion: str, joints: Callable[[JointModel], Collection[str]]
) -> dict[str, JointModel]:
    """Return the model of each joint, or kind of joints, that one stands for."""
    standing: dict[str, JointModel] = {}
    for model in models:
        for joint in joints(model):
            if joint in standing:
                raise InputError(f"two models stand for {joint!r} of {name!r}; expected one")
            if model.joint.motion != motion:
                raise InputError(
                    f"the model {model.joint.name!r} is of a joint in {model.joint.motion}; those of {name!r} are in "
                    f"{motion}"
                )
            standing[joint] = model
    return standing


def find_model_joints(rig: Rig, model: JointModel) -> set[str]:
    """Return the names of the joints that the model stands for.

    Those whose law is "model" in the rig; else those whose law has the name of the model's joint; else the only one.
    """
    joints = hinges(rig)
    if not joints:
        raise InputError(f"the rig {rig.name!r} has no joint for the model to stand for")
    marked = {hinge.name for hinge in joints if hinge.law is UNKNOWN}
    alike = {hinge.name for hinge in joints if getattr(hinge.law, "name", None) == model.joint.name}
    if marked or alike:
        return marked or alike
    if len(joints) == 1:
        return {joints[0].name}
    raise InputError(
        f'the rig {rig.name!r} has {len(joints)} joints, none of them a {model.joint.name!r}; write law = "model" '
        "for those that the model stands for"
    )


def _provide_pulse_test(
    rig: Rig, truth: dict[str, float], generator: np.random.Generator
) -> MeasuredResponse:
    if rig.measured is None:
        return virtual_pulse_test(rig, rng=generator, **truth)
    if truth:
        raise InputError(
            f"{', '.join(truth)}: belong(s) to a virtual pulse test; the rig {rig.name!r} names a measured response"
        )
    return rig.measured


def _compare_pulse(
    rig: Rig, test: MeasuredResponse, response: Any, band: Band | None, failure: str
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
    of_kind = list(zip(test.kinds, test.structure.hinges, strict=True))
    lawless = list(dict.fromkeys(kind for kind, hinge in of_kind if hinge.law is UNKNOWN))

    def kind_of(model: JointModel) -> list[str]:
        name = model.joint.name
        if name not in test.kinds and not (len(models) == len(lawless) == 1):
            raise InputError(
                f"{test.name!r} has no joint of kind {name!r}, after which the model is named; it has "
                f"{', '.join(dict.fromkeys(test.kinds))}: write kind = {name!r} for those that it stands for"
            )
        return [name] if name in test.kinds else lawless

    standing = _standing(models, test.name, test.motion, kind_of)
    left = [kind for kind in lawless if kind not in standing]
    if left:
        raise InputError(
            f"{test.name!r} has joints without a law ({', '.join(left)}); give --model: what discover wrote of it, or "
            "a model.json"
        )
    laws = {kind: model_law(model) for kind, model in standing.items()}
    placed = tuple(replace(hinge, law=laws.get(kind, hinge.law)) for kind, hinge in of_kind)
    return replace(test.structure, hinges=placed), tuple(standing.get(kind) for kind in test.kinds)
