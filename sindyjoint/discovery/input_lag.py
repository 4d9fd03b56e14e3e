"""How late a joint follows an input that moves within a run: a first-order lag, as a fluid or a coil has."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sindyjoint.discovery.delay import ROWS, Columns, law_of_channels, law_rows
from sindyjoint.discovery.factors import Factor
from sindyjoint.inputs import Input, lagged
from sindyjoint.limits import DISCOVERY
from sindyjoint.numeric import scaled_least_squares
from sindyjoint.states import ForceStates


@dataclass(frozen=True)
class InputLag:
    """The lag with which a joint follows an input.

    Parameters
    ----------
    name : str
    time : float
        Time constant of the first-order lag, s.
    removed : float
        Share of the mean square that the law and its dependences left which the lag explains.
    """

    name: str
    time: float
    removed: float


def find_lags(
    states: Sequence[ForceStates], inertia: float | None, inputs: Sequence[Input]
) -> tuple[InputLag, ...]:
    """Return the lags of inputs that move within runs and of which none is declared.

    The paper's law, each of its coefficients linear in the inputs, is fitted with every time constant that is tried. A
    lag counts that explains a stated share of what is left without it.
    """
    # Time constants, s; the best is refined between its neighbours.
    tried = np.geomspace(1e-3, 3.0, 22)
    found: list[InputLag] = []
    for each in inputs:
        if each.lag or all(np.ptp(s.inputs[each.name]) == 0 for s in states):
            continue
        law = law_of_channels(inertia, inputs)
        lags = {lag.name: lag.time for lag in found}
        without = _left(states, law, inertia, lags)
        errors = [_left(states, law, inertia, lags | {each.name: float(time)}) for time in tried]
        best = int(np.argmin(errors))
        low, high = tried[max(best - 1, 0)], tried[min(best + 1, tried.size - 1)]
        finer = np.geomspace(low, high, 9)
        again = [_left(states, law, inertia, lags | {each.name: float(time)}) for time in finer]
        removed = 1 - min(again) / without if without > 0 else 0.0
        if removed > DISCOVERY.minor_share:
            found.append(InputLag(each.name, float(f"{finer[int(np.argmin(again))]:.3g}"), removed))
    return tuple(found)


def lag_notes(lags: Sequence[InputLag]) -> list[str]:
    """Return what a report says of lags that were found."""
    return [
        f"the joint follows {lag.name} with a lag of {1e3 * lag.time:.3g} ms (time constant), which explains "
        f'{100 * lag.removed:.0f} % of the mean square left without it; lag = "{1e3 * lag.time:.3g} ms" in [inputs] '
        "declares it"
        for lag in lags
    ]


def _left(
    states: Sequence[ForceStates],
    law: Columns,
    inertia: float | None,
    lags: Mapping[str, float],
) -> float:
    """Return the sum of squares that a law leaves of the moving samples."""
    stride = max(1, sum(s.n_samples for s in states) // ROWS)
    rows = []
    for state in states:
        values = {
            name: lagged(value, lags.get(name, 0.0) * state.sample_rate)
            for name, value in state.inputs.items()
        }
        rows.append(law_rows(replace(state, inputs=values), law, inertia, stride))
    columns, target = map(np.concatenate, zip(*rows, strict=True))
    triangle = Factor.of(columns, target).triangle
    solved = scaled_least_squares(triangle[:, :-1], triangle[:, -1], 1e-10)
    return float(np.sum((triangle[:, :-1] @ solved - triangle[:, -1]) ** 2))
