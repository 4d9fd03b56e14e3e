"""Moments with internal states, and those of the excitation's frequency or of time, as a law that can be simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from sindyjoint.equation.element import Form, JointElement
from sindyjoint.equation.test_record import TEST_SIGNALS
from sindyjoint.mechanics.laws import FormulaLaw
from sindyjoint.numeric import Array
from sindyjoint.states import ForceStates

CLOCK = "clock"  # the state that gives a law the time


@dataclass(frozen=True)
class Instant:
    """When a law is asked: ``time`` s into a run that ``began`` s after the first; whether time ``runs`` on."""

    time: float = 0.0
    began: float = 0.0
    runs: bool = False

    @classmethod
    def of(cls, states: ForceStates) -> Instant:
        """Return when a run's states are: what repeats is as it is in its middle, elsewhere time runs on.

        It runs from the first sample along which internal states are brought, that of the lead where there is one.
        """
        if states.method == "periodic":
            return cls(float(np.mean(states.time)), states.began)
        early = 0 if states.lead is None else states.lead[0].size
        return cls(float(states.time[0]) - early / states.sample_rate, states.began, True)


class Part(NamedTuple):
    """A form with its numbers: nonlinear parameters, and coefficients of the columns; SI."""

    form: Form
    values: Array
    coefficients: Array


def parts_of(elements: Sequence[JointElement]) -> list[Part]:
    """Return elements as parts of a law."""
    return [Part(each.form, each.values, each.coefficients) for each in elements]


def sum_law(
    parts: Sequence[Part], frequency: float = 0.0, instant: Instant | None = None
) -> FormulaLaw | None:
    """Return the sum of the moments of some parts as a law; None where nothing adds one.

    Parameters
    ----------
    parts : sequence of Part
    frequency : float
        Of the excitation, Hz.
    instant : Instant, optional
        Time that runs is a state with the rate one.
    """
    if not parts:
        return None
    from sympy import Float, Symbol

    instant = instant or Instant()
    now = {"frequency": frequency, "time": instant.time, "elapsed": instant.time + instant.began}
    expression: Any = Float(0)
    rates: dict[str, Any] = {}
    values: dict[str, float] = {}
    for index, (form, inner, coefficients) in enumerate(parts):
        names = {n: f"p{index}_{n}" for n in form.names}
        values |= {names[n]: float(v) for n, v in zip(form.names, inner, strict=True)}
        given: dict[str, Any] = {}
        used = {symbol.name for symbol in form.symbols}
        for signal in [signal for signal in TEST_SIGNALS if signal in used]:
            # It is a parameter: another frequency, or segment of a run, needs no compilation of its own.
            values[f"at_{signal}"] = now[signal]
            given[signal] = Symbol(f"at_{signal}", real=True)
            if instant.runs and signal != "frequency":
                given[signal] += Symbol(CLOCK, real=True)
                rates[CLOCK] = Float(1)
        columns, own = form.written(names | {s.name: f"state{index}_{s.name}" for s in form.states}, given)
        for place, (column, value) in enumerate(zip(columns, coefficients, strict=True)):
            values[f"c{index}_{place}"] = float(value)
            expression += Symbol(f"c{index}_{place}", real=True) * column
        rates |= own
    return FormulaLaw(expression, values, rates)
