"""The law of a model in one run: its inputs held at the run's values, or followed along its measured motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError
from sindyjoint.mechanics.laws import Law, LawWithNumbers, SumLaw, as_compiled
from sindyjoint.numeric import Array
from sindyjoint.record import Campaign
from sindyjoint.response.model_law import model_law
from sindyjoint.response.policy import POLICY
from sindyjoint.states import ForceStates
from sindyjoint.states.campaigns import with_lags


@dataclass(frozen=True, eq=False)
class LawInRun(LawWithNumbers):
    """A law whose inputs move within a run: held at their means, and what they add along the measured motion.

    Parameters
    ----------
    added : ndarray, shape (n,)
        Moment at the samples of the run's states, N·m (N).
    moves : tuple of str
        Inputs that move the law.
    """

    added: Array
    moves: tuple[str, ...]

    @classmethod
    def of(cls, held: Law, added: Array, moves: tuple[str, ...]) -> LawInRun:
        """Return a law that is held at the means of its inputs, with what these add."""
        return cls(held, as_compiled(held).parameters, held.inertia, added, moves)


def with_added(law: Law | LawInRun, added: Law | None) -> Law | LawInRun:
    """Return a law with another one added, if there is one."""
    if added is None:
        return law
    if isinstance(law, LawInRun):
        return LawInRun.of(SumLaw(law.law, added), law.added, law.moves)
    return SumLaw(law, added)


def as_followed(campaign: Campaign, model: JointModel) -> Campaign:
    """Return a campaign whose inputs are as a model takes them: its references, and the lags of its joint.

    Raises
    ------
    InputError
        If the campaign has no input that the law depends on, or has it in a unit of another kind.
    """
    declared = {each.name: each for each in campaign.inputs}
    for each in model.used_inputs:
        other = declared.get(each.name)
        if other is None:
            raise InputError(
                f"the model depends on the input {each.name!r}, which the campaign does not have (it has "
                f"{', '.join(declared) or 'none'}); declare it in [inputs], or use the model at a value of it"
            )
        if other.unit != each.unit:
            raise InputError(
                f"the input {each.name!r} is in {other.shown_unit} in the campaign and in {each.shown_unit} in the "
                "model; state in [inputs] of the campaign a unit of the model's kind"
            )
    # One reference for the coefficients that the model has and for those that are added.
    of_model = {each.name: each.reference for each in model.inputs if each.name in declared}
    inputs = tuple(
        replace(each, reference=of_model.get(each.name, each.reference)) for each in campaign.inputs
    )
    return with_lags(replace(campaign, inputs=inputs), {each.name: each.lag for each in model.inputs})


def law_in_run(model: JointModel, states: ForceStates) -> Law | LawInRun:
    """Return the law of a model in a run.

    An input that makes the moment differ from that at its mean by less than a hundredth is held there.

    Raises
    ------
    InputError
        If the run has no value of an input on which the model depends.
    """
    used = [each.name for each in model.used_inputs]
    if not used:
        return model_law(model)
    lacking = [name for name in used if name not in states.inputs]
    if lacking:
        raise InputError(
            f"run {states.run!r} has no value of {lacking[0]!r}, on which the model depends; declare it in [inputs]"
        )
    held = model.at(**{name: float(np.mean(states.inputs[name])) for name in used})
    law = model_law(held)
    moves = tuple(name for name in used if np.ptp(states.inputs[name]) > 0)
    if not moves:
        return law
    # At standstill friction keeps the side of the motion before.
    rate = np.where(states.rate == 0, 1e-300, states.rate)
    along = model.without_elements().moment(states.angle, rate, inputs=states.inputs)
    added = along - held.without_elements().moment(states.angle, rate)
    return LawInRun.of(law, added, moves) if np.std(added) > POLICY.input_moves * np.std(along) else law


def held_laws(model: JointModel, states: Sequence[ForceStates]) -> list[Law]:
    """Return the law of a model in each run, for simulations of which no measured motion is at hand.

    Raises
    ------
    InputError
        If an input moves the law within a run.
    """
    if not any(term.inputs for term in model.terms):
        return [model_law(model)] * len(states)
    laws = [law_in_run(model, each) for each in states]
    for law, each in zip(laws, states, strict=True):
        if isinstance(law, LawInRun):
            raise InputError(
                f"{', '.join(law.moves)} moves the law within run {each.run!r}: it is not simulated"
            )
    return laws
