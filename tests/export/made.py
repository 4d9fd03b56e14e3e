"""Models to export, made from catalogue terms with given coefficients, and elements, one of each kind."""

from functools import cache

import numpy as np

from sindyjoint import JointModel
from sindyjoint.equation import (
    ElementState,
    Fitted,
    JointElement,
    Reference,
    Value,
    list_catalogues,
    load_catalogue,
    model_terms,
)
from sindyjoint.record import Joint

# Table 1 of the paper, inter-panel joint, and the range in which it was tested here.
PAPER = {
    "linear_stiffness": 6.066e3,
    "quadratic_stiffness": -1.927e5,
    "cubic_stiffness": -2.684e9,
    "linear_damping": 48.13,
    "coulomb_friction": 1.867,
}
ANGLE, RATE, MOMENT_RMS = 7.7e-4, 4.4e-2, 3.55


@cache
def shipped_terms():
    """Every term of every shipped library, by id; those of inputs are held before they are exported."""
    every = (term for found in list_catalogues() for term in load_catalogue(found.name))
    return {term.id: term for term in every if not term.inputs}


def model_of(
    coefficients=PAPER,
    *,
    motion="rotation",
    inertia=0.02,
    name="inter-panel joint",
    moment_rms=MOMENT_RMS,
    elements=(),
):
    """Return a model of coefficients by term id."""
    catalogue = shipped_terms()
    reference = Reference(angle=ANGLE, rate=RATE, moment=2 * moment_rms)
    resolved = [catalogue[term_id].resolve(reference) for term_id in coefficients]
    values = np.array(list(coefficients.values()))
    covariance = np.diag((1e-3 * values) ** 2)
    terms = model_terms(resolved, values, covariance, np.full(values.size, 0.2), 1000, motion)
    fitted = Fitted(moment_rms, 0.03, 0.03, 0.6, 50000, 12, ANGLE, RATE, (3.0, 4.0))
    elements = tuple(elements)
    errors = np.concatenate([1e-3 * values, *([n.standard_error for n in e.numbers] for e in elements)])
    return JointModel(
        Joint(name=name, motion=motion, inertia=inertia),
        terms,
        tuple(map(tuple, np.diag(errors**2).tolist())),
        fitted,
        elements,
    )


def element(effect, column, coefficient, parameters, rate, limit=None, name="z"):
    """An element with one column and one state; formulas as in libraries/effects/memory.toml."""

    def number(key, value, formula=""):
        return Value(key, value, 0.01 * abs(value), (0.98 * value, 1.02 * value), "", formula)

    return JointElement(
        id=effect,
        effect=effect,
        symbol=column[0],
        name=effect.replace("_", " "),
        columns=(number(column[0], coefficient, column[1]),),
        parameters=tuple(number(key, value) for key, value in parameters.items()),
        states=(ElementState(name, "rad", rate, limit),),
    )


# A fifth to a third of the tested moment each, yielding well inside the tested angle.
ELEMENTS = {
    "jenkins_element": element(
        "jenkins_element", ("k_t", "z"), 5e3, {"theta_y": 2e-4}, "omega", "theta_y"
    ),
    "backlash_play": element(
        "backlash_play", ("M_g", "sign(z)*min(max((abs(z) - gap)/ramp, 0), 1)"), 1.0,
        {"gap": 1.2e-4, "ramp": 0.8e-4}, "omega", "gap + ramp",
    ),
    "dahl_friction": element(
        "dahl_friction", ("k_z", "z"), 1e4, {"theta_y": 1e-4}, "omega - abs(omega)*z/theta_y"
    ),
    "bouc_wen_hysteresis": element(
        "bouc_wen_hysteresis", ("k_z", "z"), 6e3, {"theta_y": 2e-4, "shape": 1.3},
        "omega - (abs(omega)*z*abs(z) + (shape - 2)*omega*z**2)/theta_y**2",
    ),
    "lugre_friction": element(
        "lugre_friction", ("sigma_0", "z"), 2e4, {"theta_y": 4e-5, "rise": 0.4, "v_s": 6e-3},
        "omega - abs(omega)*z/(theta_y*(1 + rise*exp(-(omega/v_s)**2)))",
    ),
    "maxwell_branch": element(
        "maxwell_branch", ("k_m", "q"), 2e3, {"tau": 0.03}, "omega - q/tau", name="q"
    ),
}  # fmt: skip
