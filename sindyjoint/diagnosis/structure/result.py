"""What a diagnosis of a structure ends with: its model beside the effects, and its warnings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sindyjoint.diagnosis.result import RecordGap
from sindyjoint.diagnosis.structure.output_error import Fit, PulseProblem, prior_root
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.response.model_law import with_coefficients


def model_after(problem: PulseProblem, best: Fit) -> JointModel:
    """Return the model with its coefficients and covariance beside the effects."""
    model = problem.model
    kept = [i for i, term in enumerate(model.terms) if term.id != INERTIA]
    root = prior_root(model, problem.policy.model_error)
    values = model.coefficients.copy()
    values[kept] += root @ best.x[2 : problem.priors]
    normal = best.jacobian.T @ best.jacobian
    scale = np.sqrt(np.diag(normal))
    scale[scale == 0] = 1.0
    inverse = np.linalg.pinv(normal / np.outer(scale, scale), hermitian=True) / np.outer(scale, scale)
    covariance = np.asarray(model.covariance, dtype=np.float64).reshape(values.size, -1).copy()
    own = slice(2, problem.priors)
    covariance[np.ix_(kept, kept)] = root @ inverse[own, own] @ root.T
    return with_coefficients(model, values, (covariance + covariance.T) / 2)


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
