"""Pulse tests of random rigs with something hidden in them, made with the simulator alone: the referee of diagnosis.

No code of discrepancy or of the diagnosis is used. The model in the joint is near the truth: its coefficients are drawn
from a covariance that it states.
"""

from dataclasses import dataclass, replace

import numpy as np

from sindyjoint.mechanics import (
    INTER_PANEL,
    Beam,
    FunctionLaw,
    LumpedMass,
    MeasuredResponse,
    PaperLaw,
    load_rig,
    with_laws,
    with_loss_factor,
)
from tests.made_models import paper_model

NAMES = ("beam_loss", "lumped_mass", "clamp_stiffness", "dahl", "jenkins", "pulse_scale", "nothing")
OUTSIDE = ("ripple",)
# What may be named for what was hidden.
CALLED = {
    "dahl": {"dahl_friction"},
    "jenkins": {"jenkins_element"},
}


def _dahl(theta, omega, direction, state, p, out):
    out[0] = theta * (p[0] + theta * (p[1] + theta * p[2])) + p[3] * omega + p[4] * state[0]
    out[1] = (omega - abs(omega) * state[0]) / p[5]


def _jenkins(theta, omega, direction, state, p, out):
    out[0] = theta * (p[0] + theta * (p[1] + theta * p[2])) + p[3] * omega + p[4] * state[0]
    yielding = (state[0] >= 1.0 and omega > 0) or (state[0] <= -1.0 and omega < 0)
    out[1] = 0.0 if yielding else omega / p[5]


def _ripple(theta, omega, direction, state, p, out):
    out[0] = theta * (p[0] + theta * (p[1] + theta * p[2])) + p[3] * omega + p[4] * direction
    out[0] += p[5] * np.sin(theta / p[6])


@dataclass(frozen=True)
class HiddenStructure:
    """A rig with its record, the model that is to be diagnosed, what is hidden, and the rig that holds it."""

    name: str
    rig: object
    model: object
    size: float
    truth: object


def hide(name, seed, noise=0.01, duration=6.0, size=None, error=0.003):
    """Return a random rig's pulse test with an effect in it; the model's coefficients err by ``error``."""
    generator = np.random.default_rng(70_000 + seed)
    rig = replace(load_rig("pulse-rig"), duration=duration)
    length, mass = generator.uniform(0.42, 0.58, 2), generator.uniform(6, 10)
    beams = iter(length)
    items = tuple(
        replace(i, length=float(next(beams))) if isinstance(i, Beam) else replace(i, mass=float(mass))
        if isinstance(i, LumpedMass) else i
        for i in rig.items
    )  # fmt: skip
    rig = replace(rig, items=items, excitation=rig.excitation.scaled(float(generator.uniform(0.8, 1.2))))
    model = paper_model(error)
    values = model.coefficients * (1 + error * generator.standard_normal(model.coefficients.size))
    law = PaperLaw(*map(float, values), inertia=INTER_PANEL.inertia)
    sign = float(generator.choice([-1.0, 1.0]))
    draw = generator.uniform(0, 1)
    truth = with_laws(rig, lambda hinge: law)
    size, truth = _with(name, truth, law, sign, draw, size)
    response = truth.respond()
    ideal = response.displacement["tip"]
    shown = ideal + noise * np.sqrt(np.mean(ideal**2)) * generator.standard_normal(ideal.size)
    return HiddenStructure(
        name, replace(rig, measured=MeasuredResponse("tip", shown, rig.sample_rate)), model, size, truth
    )


def _with(name, rig, law, sign, draw, size):
    """Return the size and the rig with the effect; sizes are drawn within what a rig may plausibly hide."""
    spans = {
        "beam_loss": (0.002, 0.01), "lumped_mass": (0.01, 0.06), "clamp_stiffness": (0.002, 0.02),
        "dahl": (5e-6, 6e-5), "jenkins": (5e-6, 6e-5), "pulse_scale": (0.02, 0.08), "ripple": (0.2, 0.5),
    }  # fmt: skip
    if name == "nothing":
        return 0.0, rig
    low, high = spans[name]
    size = low * (high / low) ** draw if size is None else size
    if name == "beam_loss":
        return size, with_loss_factor(rig, 0.004 + size)
    if name == "lumped_mass":
        items = tuple(
            replace(i, mass=i.mass * (1 + sign * size)) if isinstance(i, LumpedMass) else i for i in rig.items
        )
        return sign * size, replace(rig, items=items)
    if name == "clamp_stiffness":
        first = next(i for i in rig.items if isinstance(i, Beam))
        return size, replace(rig, clamp_stiffness=first.bending_stiffness / first.length / size)
    if name == "pulse_scale":
        return sign * size, replace(rig, excitation=rig.excitation.scaled(1 + sign * size))
    if name == "ripple":
        wavy = FunctionLaw(_ripple, (*law.parameters, size, 1.5e-5), inertia=law.inertia)
        return size, with_laws(rig, lambda hinge: wavy)
    function = {"dahl": _dahl, "jenkins": _jenkins}[name]
    memory = FunctionLaw(function, (*law.parameters, size), n_states=1, inertia=law.inertia)
    return size, with_laws(rig, lambda hinge: memory)
