"""What a diagnosis of a structure ends with: its model beside the effects, and its warnings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.effects.change import Change
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.effects.joint import FRICTION, JointLaws, place_of
from sindyjoint.diagnosis.result import RecordGap
from sindyjoint.diagnosis.structure.output_error import Fit, PulseProblem, prior_root
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.numeric import Array
from sindyjoint.response.model_law import with_coefficients

# Step of the differences, in the scaled numbers of the fit.
STEP = 1e-4


def model_after(problem: PulseProblem, best: Fit) -> JointModel:
    """Return the model with its coefficients and covariance beside the effects."""
    model = problem.model
    kept = [i for i, term in enumerate(model.terms) if term.id != INERTIA]
    root = prior_root(model, problem.policy.model_error)
    values = model.coefficients.copy()
    values[kept] += root @ best.x[2 : problem.priors]
    covariance = model.covariance_matrix[: values.size, : values.size]
    own = slice(2, problem.priors)
    covariance[np.ix_(kept, kept)] = root @ _inverse(best)[own, own] @ root.T
    return with_coefficients(model, values, (covariance + covariance.T) / 2)


def whole_model(problem: PulseProblem, best: Fit) -> JointModel:
    """Return the model with what the effects change in the joint's law: terms, and elements with a memory.

    Effects outside of the joint belong to the structure. The covariance is that of the fit, by linearisation.
    """
    changes = [change for change in problem.found if change.inside]
    after = model_after(problem, best)
    if not changes:
        return after

    def assembled(x: Array) -> JointModel:
        return assemble_model(problem.setup(x).numbers, problem.laws, after, changes)

    return with_slopes(assembled, best.x, problem.bounds()[1], _inverse(best))


def with_slopes(
    assembled: Callable[[Array], JointModel], x: Array, high: Array, covariance: Array
) -> JointModel:
    """Return the model of some numbers of a fit with the covariance that follows from theirs, by linearisation."""
    whole = assembled(x)
    slopes = np.empty((whole.numbers.size, x.size))
    for place in range(x.size):
        step = np.zeros(x.size)
        step[place] = STEP if x[place] + STEP <= high[place] else -STEP
        slopes[:, place] = (assembled(x + step).numbers - whole.numbers) / step[place]
    spread = slopes @ covariance @ slopes.T
    return whole.with_numbers(whole.numbers, (spread + spread.T) / 2)


def assemble_model(
    numbers: Mapping[str, float], laws: JointLaws, after: JointModel, changes: Sequence[Change]
) -> JointModel:
    """Return the whole model of a law's numbers with what changes have added; its errors are not yet known."""
    additions = [(change, laws.additions.get(change.way)) for change in changes]
    replacing = [each for _, each in additions if each is not None and each.replaces]
    terms, elements = [], list(after.elements)
    for term in after.terms:
        if not (term.id == FRICTION and replacing):
            terms.append(replace(term, coefficient=numbers.get(place_of(term.id), term.coefficient)))
    for change, addition in additions:
        if addition is None:
            continue
        names = [f"c{k}" for k in range(len(addition.variant.columns))]
        coefficients = [numbers.get(addition.name(name), 0.0) for name in names]
        if addition.replaces:
            # It carries the friction: its column comes to `level` under steady slip.
            friction = numbers[place_of(FRICTION)] / len(replacing)
            coefficients = [friction / numbers[addition.name("level")]]
        values = [numbers[addition.name(name)] for name in addition.variant.names]
        added = FittedEffect(change.effect, addition.variant, np.array(values), np.array(coefficients), 0.0)
        if addition.variant.states:
            elements.append(added.element())
        else:
            terms += added.terms()
    return replace(after, terms=tuple(terms), elements=tuple(elements), covariance=())


def _inverse(best: Fit) -> Array:
    """Return the covariance of the numbers of a fit, from its Jacobian in units of noise."""
    normal = best.jacobian.T @ best.jacobian
    scale = np.sqrt(np.diag(normal))
    scale[scale == 0] = 1.0
    inverse: Array = np.linalg.pinv(normal / np.outer(scale, scale), hermitian=True) / np.outer(scale, scale)
    return inverse


def warnings_of(
    problem: PulseProblem, records: Sequence[RecordGap], virtual: bool, drawn: bool, others: bool
) -> tuple[str, ...]:
    """Return what to know before believing the diagnosis.

    Records may be simulated (``virtual``), the model be ``drawn`` from the rig's own law, and ``others`` be held out.
    """
    lines = []
    if virtual:
        lines.append("the response is simulated (a virtual pulse test of the rig), not measured")
    if drawn:
        share = 100 * problem.policy.known_to
        lines.append(
            f"no model was given: the terms of the rig's own joint were taken as known to {share:.3g} %"
        )
    if not others:
        lines.append(
            f"one pulse only: the gaps are those of a fit to the first {records[0].held_from:.3g} s, told on the rest"
        )
    for record, noise in zip(problem.records, problem.noise, strict=True):
        if noise.length > 3:
            lines.append(
                f"the noise at {record.point} is not white: {noise.length:.3g} neighbouring samples count as one"
            )
    for error, noise in zip(problem.step_error, problem.noise, strict=False):
        if np.sqrt(np.mean(error**2)) > 3 * noise.sigma:
            lines.append(
                f"the time step of {problem.rig.step:g} s is coarse for this noise; reduce step in [output]"
            )
            break
    return tuple(lines)
