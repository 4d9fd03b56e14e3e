"""The parameters of the output-error problem: where they start, their scales, and how far they may move."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, NamedTuple

from sindyjoint.equation.element import JointElement
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.response.policy import POLICY

Nuisance = Literal["delay", "gain", "offset"]


class NuisanceKind(NamedTuple):
    """What a nuisance parameter starts at and how it is written."""

    start: float
    unit: str


NUISANCE: dict[Nuisance, NuisanceKind] = {
    "delay": NuisanceKind(0.0, " s"),
    "gain": NuisanceKind(1.0, ""),
    "offset": NuisanceKind(0.0, ""),
}


@dataclass(frozen=True)
class Parameter:
    """A parameter of the problem.

    Parameters
    ----------
    name : str
    kind : {"coefficient", "element", "nuisance", "initial"}
    start, scale, low, high : float
        In the parameter's unit.
    """

    name: str
    kind: str
    start: float
    scale: float
    low: float
    high: float


def coefficient(model: JointModel, name: str, moment: float) -> Parameter:
    """Return a coefficient of the model, and how far it may move.

    Negative friction starts at zero and may become as large as the RMS of the moment.
    """
    term = model[name]
    value = term.coefficient
    scale = abs(value) if value != 0 else max(term.standard_error, 1e-12)
    # The coefficient that would carry the whole moment, as far as the term's share is known.
    whole = scale / term.unique_share if term.unique_share > 0 else 0.0
    reach = max(
        POLICY.range_share * scale, POLICY.range_errors * term.standard_error, POLICY.range_moment * whole
    )
    low, high = value - reach, value + reach
    if name == "coulomb_friction" and value < 0:
        return Parameter(name, "coefficient", 0.0, scale, 0.0, moment)
    if name == "coulomb_friction":
        low = max(low, 0.0)
    if name == INERTIA:
        low = max(low, 0.1 * value)
    return Parameter(name, "coefficient", value, scale, low, high)


def element_parameters(elements: Iterable[JointElement]) -> Iterable[Parameter]:
    """Yield the numbers of elements as parameters, in the order of a model's numbers; each keeps its sign."""
    for element in elements:
        coefficients = {column.name for column in element.columns}
        for number in element.numbers:
            if number.name in coefficients:
                reach = POLICY.element_range
            else:
                reach = POLICY.shape_range if number.unit in ("", "1") else POLICY.nonlinear_range
            value = number.value
            scale = abs(value) if value != 0 else max(number.standard_error, 1e-12)
            ends = sorted((value / reach, value * reach)) if value != 0 else (-reach * scale, reach * scale)
            yield Parameter(f"{number.name} of {element.id}", "element", value, scale, *ends)


def nuisance_parameter(name: Nuisance, size: float, period: float) -> Parameter:
    """Return a nuisance parameter for a response of this RMS whose fastest motion has this period, s."""
    start = NUISANCE[name].start
    reach = {
        "delay": POLICY.delay_range * period,
        "gain": POLICY.gain_range,
        "offset": POLICY.offset_range * size,
    }[name]
    # A gain is one of one, a delay and an offset are small: their scale is a hundredth of the motion's.
    scale = {"delay": 0.01 * period, "gain": 1.0, "offset": 0.01 * size}[name]
    return Parameter(name, "nuisance", start, scale, start - reach, start + reach)
