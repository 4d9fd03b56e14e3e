"""What a diagnosis of a structure starts from: the rig, the model in its joint, its records, the effects to try."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from sindyjoint.diagnosis.effects.catalogue import Effect, load_effects
from sindyjoint.diagnosis.effects.change import Change, structure_changes
from sindyjoint.diagnosis.effects.joint import joint_changes
from sindyjoint.diagnosis.effects.setup import PLACES, Scales
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.diagnosis.structure.hidden import model_of_law
from sindyjoint.diagnosis.structure.kinds import JointKind
from sindyjoint.diagnosis.structure.noise import RecordNoise, record_noise
from sindyjoint.diagnosis.structure.output_error import Fit, fit
from sindyjoint.diagnosis.structure.pulses import PulseProblem
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.equation.terms import Reference
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.mechanics.laws import PaperLaw
from sindyjoint.mechanics.pulse_test import hinges, with_laws
from sindyjoint.mechanics.rigs import MeasuredResponse, Rig, load_rig, shipped_rigs
from sindyjoint.response.model_law import model_law
from sindyjoint.response.oscillation import main_frequency
from sindyjoint.response.verify_campaign import GIVEN
from sindyjoint.response.verify_rig import (
    MODEL_PLACEHOLDER,
    PLACEHOLDERS,
    find_model_joints,
    joint_range_warnings,
)


def open_rig(rig: Rig | str | Path) -> Rig:
    """Return a rig, the rig of a file, or a shipped one by its name."""
    if isinstance(rig, Rig):
        return rig
    if str(rig) in shipped_rigs():
        return load_rig(str(rig))
    return load_rig(rig, PLACEHOLDERS)


def model_in_place(
    rig: Rig, model: JointModel | None, policy: DiagnosisPolicy
) -> tuple[JointModel, frozenset[str], bool]:
    """Return the model, the joints it stands for, and whether it was made of the rig's own law."""
    if model is not None:
        if model.joint.motion != "rotation":
            raise InputError("the model is of a joint in translation; the joints of a rig rotate")
        if not [term for term in model.terms if term.id != INERTIA]:
            raise InputError("the model has no terms: there is nothing to simulate; run discover first")
        return model, frozenset(find_model_joints(rig, model)), False
    laws = {hinge.law for hinge in hinges(rig)}
    if not laws or MODEL_PLACEHOLDER in laws or not all(isinstance(law, PaperLaw) for law in laws):
        raise InputError(
            f"the rig {rig.name!r} gives no law for its joint; give the model that stands there (--model)"
        )
    law = hinges(rig)[0].law
    try:
        motion = rig.respond()
    except SimulationError as error:
        raise InputError(f"the rig {rig.name!r} cannot be simulated: {error}") from error
    assert isinstance(law, PaperLaw)
    angle, rate = (float(np.abs(x).max(initial=0.0)) for x in (motion.angle, motion.rate))
    places = frozenset(h.name for h in hinges(rig) if h.law == law)
    return model_of_law(law, angle, rate, policy.known_to), places, True


def pulse_problem(
    rig: Rig,
    model: JointModel,
    places: frozenset[str],
    effects: Sequence[Effect],
    policy: DiagnosisPolicy,
) -> tuple[PulseProblem, tuple[Change, ...], float, tuple[str, ...]]:
    """Return the problem, its candidates, the period of the main oscillation, s, and where the model was not tested."""
    records, noise = _measured(rig, policy)
    law = model_law(model)
    kind = JointKind.of(model.joint.name, (), model, policy.model_error)
    problem = PulseProblem(
        rig, places, kind, records, noise, pulse_uncertainty=rig.pulse_uncertainty, policy=policy
    )
    in_place = with_laws(rig, lambda hinge: law if hinge.name in places else hinge.law)
    try:
        motion = in_place.respond(duration=problem.duration)
    except SimulationError as error:
        raise SimulationError(f"the rig {rig.name!r} cannot be simulated with the model: {error}") from error
    rows = [i for i, hinge in enumerate(hinges(rig)) if hinge.name in places]
    angle, rate, moment = (float(np.abs(x[rows]).max()) for x in (motion.angle, motion.rate, motion.moment))
    problem = problem.prepared(problem.start())
    period = 1 / main_frequency(records[0].displacement, records[0].sample_rate)
    scales = Scales(period, float(np.std(records[0].displacement)), problem.duration)
    outside = structure_changes(outside_joints(effects), problem.setup(problem.start()), scales)
    beyond = tuple(joint_range_warnings(model, motion, places, GIVEN))
    return (
        problem,
        (*outside, *joint_changes(kind.laws, effects, Reference(angle, rate), moment)),
        period,
        beyond,
    )


def _measured(
    rig: Rig, policy: DiagnosisPolicy
) -> tuple[tuple[MeasuredResponse, ...], tuple[RecordNoise, ...]]:
    """Return the records of a rig that names some, and the noise of each."""
    assert rig.measured is not None
    records = (rig.measured, *rig.also_measured)
    return records, tuple(record_noise(r.displacement, r.sample_rate, policy) for r in records)


def outside_joints(effects: Sequence[Effect]) -> Sequence[Effect]:
    """Return the effects outside the joints: the shipped ones, and those among others."""
    own = [effect for effect in effects if effect.enters in PLACES]
    return list({effect.id: effect for effect in (*load_effects(of="structure"), *own)}.values())


def other_pulse(problem: PulseProblem, rig: Rig) -> PulseProblem:
    """Return the problem of another pulse of the same structure."""
    if rig.measured is None:
        raise InputError(f"the rig {rig.name!r} of hold_out names no measured response")
    if [type(i) for i in rig.items] != [type(i) for i in problem.rig.items]:
        raise InputError(f"the rig {rig.name!r} of hold_out has another chain than {problem.rig.name!r}")
    records, noise = _measured(rig, problem.policy)
    return replace(problem, rig=rig, records=records, noise=noise, step_error=(), _kept={})


def first_fit(problem: PulseProblem) -> Fit:
    """Return the model's coefficients within their uncertainty."""
    # Whole cycles off, the model's coefficients only follow the gap: a few parts in a hundred are not worth the time.
    best = fit(problem, problem.start(), problem.duration, iterations=4, relative=0.02)
    if best is None:
        raise InputError(
            f"the rig {problem.rig.name!r} cannot be simulated with the model and its uncertainty"
        )
    return best
