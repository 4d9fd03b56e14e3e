"""Where the joints of a structure move beyond the range that their models were tested to."""

from __future__ import annotations

import numpy as np

from sindyjoint.diagnosis.structure.runs import RunsProblem
from sindyjoint.equation.model_parts import range_warnings
from sindyjoint.response.verify_campaign import GIVEN
from sindyjoint.substructure.simulated.steady import complex_amplitudes

# Of a period, at which angle and rate are held against the range.
PHASES = 512


def beyond_tested(problem: RunsProblem) -> list[str]:
    """Return a warning for each run and joint that moves beyond what its model, as given, was tested to."""
    lines: list[str] = []
    names = [hinge.name for hinge in problem.test.structure.hinges]
    for place, run in enumerate(problem.runs):
        found = problem.answer(place, problem.start())
        if found is None:
            continue
        angles = complex_amplitudes(found[0].angles, len(names))
        omega = run.omega * np.arange(angles.shape[1])
        wave = np.exp(1j * np.outer(omega, np.linspace(0, 2 * np.pi / run.omega, PHASES, endpoint=False)))
        angle, rate = (angles @ wave).real, (1j * omega * angles @ wave).real
        for kind in problem.kinds:
            fitted, motion = kind.model.fitted, kind.model.joint.motion
            for at in kind.places:
                lines += range_warnings(
                    fitted, motion, angle[at], rate[at], f"{GIVEN}{run.name}, {names[at]}"
                )
    return lines
