"""A virtual pulse test in which the seed hides what is missing, and the model that a rig's own joint amounts to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sindyjoint.equation.model import Fitted, JointModel, ModelTerm
from sindyjoint.errors import InputError
from sindyjoint.mechanics.beam import Beam
from sindyjoint.mechanics.laws import PaperLaw
from sindyjoint.mechanics.pulse_test import hinges, presliding_law, with_laws, with_loss_factor
from sindyjoint.mechanics.rigs import MeasuredResponse, Rig
from sindyjoint.mechanics.sensors import Channel
from sindyjoint.mechanics.structure import LumpedMass
from sindyjoint.paper import PARAMETERS as PAPER_PARAMETERS
from sindyjoint.record import Joint
from sindyjoint.response.model_law import draw_models, model_law
from sindyjoint.response.verify_rig import MODEL_PLACEHOLDER

CHOICES = ("beam_loss", "lumped_mass", "clamp_stiffness", "dahl_friction", "nothing")
NOISE = 0.01


def model_of_law(law: PaperLaw, angle: float, rate: float, known_to: float) -> JointModel:
    """Return the five terms of a joint's law as a model, each known to a share of itself.

    ``angle`` (rad) and ``rate`` (rad/s) are the largest ones of its motion.
    """
    from sindyjoint.equation.catalogue import load_catalogue

    catalogue = load_catalogue("paper")
    terms = []
    for term in catalogue:
        if term.id not in PAPER_PARAMETERS:
            continue
        value = float(getattr(law, PAPER_PARAMETERS[term.id]))
        error = known_to * abs(value)
        interval = (value - 1.96 * error, value + 1.96 * error)
        terms.append(
            ModelTerm(
                term.id, term.symbol, term.name, term.family, term.formula, (), term.unit, value, error, interval, 0.0
            )
        )  # fmt: skip
    covariance = np.diag([term.standard_error**2 for term in terms])
    moment = abs(law.k1) * angle + law.M_F
    return JointModel(
        Joint(name=law.name, inertia=law.inertia), tuple(terms), tuple(map(tuple, covariance.tolist())),
        Fitted(moment, 0.0, 0.0, 1.0, 0, 0, angle, rate, (), True),
    )  # fmt: skip


def hidden_pulse_test(
    rig: Rig, places: frozenset[str], model: JointModel, generator: np.random.Generator, drawn: bool
) -> tuple[Rig, str]:
    """Return the rig with records of a virtual pulse test, and what the generator hid in it.

    The true joint is ``drawn`` from the covariance of the model, which stands for the joints at ``places``, or is the
    rig's own.
    """
    if any(hinge.law is MODEL_PLACEHOLDER for hinge in hinges(rig)):
        raise InputError(
            f"the rig {rig.name!r} has a joint whose law is 'model' and no measured response: a virtual test needs the "
            "true law; add a [measured] table, or name a shipped joint as the law"
        )
    truth = rig
    if drawn:
        law = model_law(draw_models(model, 1, generator)[0])
        truth = with_laws(rig, lambda hinge: law if hinge.name in places else hinge.law)
    name = str(generator.choice(CHOICES))
    if name == "dahl_friction" and not all(isinstance(h.law, PaperLaw) for h in hinges(truth)):
        name = "beam_loss"
    truth = hide(truth, name, float(generator.uniform(0.5, 1.5)))
    response = truth.respond()
    records = tuple(
        MeasuredResponse(point, Channel(noise=NOISE).read(response.displacement[point], generator), rig.sample_rate)
        for point in rig.points
    )  # fmt: skip
    return replace(rig, measured=records[0], also_measured=records[1:]), name


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
    if name == "nothing":
        return rig
    if name == "beam_loss":
        return with_loss_factor(rig, max(b.loss_factor for b in beams) + 0.004 * size)
    if name == "lumped_mass":
        items = tuple(
            replace(i, mass=i.mass * (1 + 0.04 * size)) if isinstance(i, LumpedMass) else i for i in rig.items
        )
        return replace(rig, items=items)
    if name == "clamp_stiffness":
        compliance = 0.005 * size * beams[0].length / beams[0].bending_stiffness
        return replace(rig, clamp_stiffness=1 / (compliance + 1 / rig.clamp_stiffness))
    if name == "dahl_friction":
        return with_laws(
            rig,
            lambda hinge: (
                presliding_law(hinge.law, 20e-6 * size) if isinstance(hinge.law, PaperLaw) else hinge.law
            ),
        )
    raise InputError(f"nothing called {name!r} can be hidden; expected one of {', '.join(CHOICES)}")
