"""What a diagnosis of a pulse test starts from: rig, model, candidates, and records or a virtual test."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from sindyjoint.diagnosis.effects import Effect, load_effects
from sindyjoint.diagnosis.effects.change import Change, joint_changes, structure_changes
from sindyjoint.diagnosis.effects.setup import PLACES, Scales
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.diagnosis.structure import Fit, fit
from sindyjoint.diagnosis.structure.kinds import JointKind
from sindyjoint.diagnosis.structure.pulses import PulseProblem, RecordNoise, record_noise
from sindyjoint.equation.model import INERTIA, Fitted, JointModel, model_terms
from sindyjoint.equation.terms import Reference
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.mechanics import Law, PaperLaw
from sindyjoint.mechanics.beam import Beam
from sindyjoint.mechanics.rig_file import shipped_rigs
from sindyjoint.mechanics.rigs import PLACEHOLDERS, UNKNOWN, MeasuredResponse, Rig, load_rig
from sindyjoint.mechanics.structure import LumpedMass
from sindyjoint.mechanics.virtual_rig import (
    hinges,
    presliding_law,
    virtual_records,
    with_laws,
    with_loss_factor,
)
from sindyjoint.numeric import main_frequency
from sindyjoint.paper import PARAMETERS as PAPER_PARAMETERS
from sindyjoint.record import Joint
from sindyjoint.response.laws import draw_models, model_law
from sindyjoint.response.verify_campaign import GIVEN
from sindyjoint.response.verify_rig import (
    find_model_joints,
    joint_range_warnings,
)

CHOICES = ("beam_loss", "lumped_mass", "clamp_stiffness", "dahl_friction", "nothing")


def model_of_law(law: PaperLaw, angle: float, rate: float, known_to: float) -> JointModel:
    """Return the five terms of a joint's law as a model, each known to a share of itself.

    ``angle`` (rad) and ``rate`` (rad/s) are the largest ones of its motion.
    """
    from sindyjoint.equation.catalogue import load_catalogue

    terms = [t.with_parameters({}) for t in load_catalogue("paper") if t.id in PAPER_PARAMETERS]
    values = np.array([getattr(law, PAPER_PARAMETERS[term.id]) for term in terms], dtype=float)
    covariance = np.diag((known_to * values) ** 2)
    fitted = Fitted(abs(law.k1) * angle + law.M_F, 0.0, 0.0, 1.0, 0, 0, angle, rate, (), True)
    known = model_terms(terms, values, covariance, np.zeros(values.size), np.inf, "rotation")
    model = JointModel(Joint(name=law.name, inertia=law.inertia), known, (), fitted)
    return model.with_numbers(values, covariance)


def hidden_pulse_test(
    rig: Rig, places: frozenset[str], model: JointModel, generator: np.random.Generator, drawn: bool
) -> tuple[Rig, str]:
    """Return the rig with records of a virtual pulse test, and what the generator hid in it.

    The true joint is ``drawn`` from the covariance of the model, which stands for the joints at ``places``, or is the
    rig's own.
    """
    truth = rig
    if drawn:
        law = model_law(draw_models(model, 1, generator)[0])
        truth = with_laws(rig, lambda hinge: law if hinge.name in places else hinge.law)
    name = str(generator.choice(CHOICES))
    if name == "dahl_friction" and not all(isinstance(h.law, PaperLaw) for h in hinges(truth)):
        name = "beam_loss"
    truth = hide(truth, name, float(generator.uniform(0.5, 1.5)))
    first, *others = virtual_records(truth, 0.01, generator)
    return replace(rig, measured=first, also_measured=tuple(others)), name


def hide(rig: Rig, name: str, size: float = 1.0) -> Rig:
    """Return a rig with one effect in it.

    Parameters
    ----------
    rig : Rig
    name : str
        One of :data:`CHOICES`.
    size : float
        One: a loss factor larger by 0.004, a lumped mass by 4 %, a clamp that adds 0.5 % of the first beam's
        compliance, or friction that gives way over 20 µrad.
    """
    beams = [item for item in rig.items if isinstance(item, Beam)]
    compliance = 0.005 * size * beams[0].length / beams[0].bending_stiffness
    heavier = [
        replace(i, mass=i.mass * (1 + 0.04 * size)) if isinstance(i, LumpedMass) else i for i in rig.items
    ]
    law: Callable[[Any], Law] = partial(presliding_law, angle=20e-6 * size)
    changed: dict[str, Callable[[], Rig]] = {
        "beam_loss": lambda: with_loss_factor(rig, max(b.loss_factor for b in beams) + 0.004 * size),
        "lumped_mass": lambda: replace(rig, items=tuple(heavier)),
        "clamp_stiffness": lambda: replace(rig, clamp_stiffness=1 / (compliance + 1 / rig.clamp_stiffness)),
        "dahl_friction": lambda: with_laws(rig, lambda hinge: law(hinge.law)),
        "nothing": lambda: rig,
    }
    return changed[name]()


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
    if not laws or UNKNOWN in laws or not all(isinstance(law, PaperLaw) for law in laws):
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
    return model_of_law(law, angle, rate, policy.trivial_share), places, True


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
    kind = JointKind.of(model.joint.name, (), model, policy.granted_share)
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
