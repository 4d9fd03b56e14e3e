"""Where the joints of a structure move beyond the range that their models were tested to."""

from __future__ import annotations

import numpy as np

from sindyjoint.diagnosis.structure.motions import joint_motions
from sindyjoint.diagnosis.structure.runs import RunsProblem
from sindyjoint.equation.model_parts import range_warnings
from sindyjoint.numeric import Array
from sindyjoint.response.verify_campaign import GIVEN


def beyond_tested(problem: RunsProblem) -> list[str]:
    """Return a warning for each run and joint that moves beyond what its model, as given, was tested to."""
    names = [hinge.name for hinge in problem.test.structure.hinges]
    motions: dict[str, list[tuple[Array, Array]]] = {}
    for name, angle, rate in joint_motions(problem, problem.start()):
        motions.setdefault(name, []).append((angle, rate))
    lines: list[str] = []
    for run, parts in motions.items():
        angle, rate = (np.concatenate(each, axis=1) for each in zip(*parts, strict=True))
        for kind in problem.kinds:
            fitted, motion = kind.model.fitted, kind.model.joint.motion
            for at in kind.places:
                lines += range_warnings(fitted, motion, angle[at], rate[at], f"{GIVEN}{run}, {names[at]}")
    return lines
