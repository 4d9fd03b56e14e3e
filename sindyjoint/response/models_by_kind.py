"""Models in the place of the joints of a structure, by their kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.mechanics.rig_test_file import UNKNOWN
from sindyjoint.mechanics.structure import Structure
from sindyjoint.response.model_law import model_law


def place_by_kind(
    test: RigTest, models: Sequence[JointModel]
) -> tuple[Structure, tuple[JointModel | None, ...]]:
    """Return a structure whose joints have their laws, and the model of each joint where it has one.

    A model stands for the joints whose kind has its name; a single one also for those without a law, if these are of
    one kind.

    Raises
    ------
    InputError
        For a model that fits no joint, two for one kind, or a joint that is left without a law.
    """
    standing: dict[str, JointModel] = {}
    for model in models:
        kind = _kind_of(test, model, len(models) == 1)
        if kind in standing:
            raise InputError(f"two models stand for {kind!r} of {test.name!r}; expected one")
        if model.joint.motion != test.motion:
            raise InputError(
                f"the model {model.joint.name!r} is of a joint in {model.joint.motion}; those of {test.name!r} are in "
                f"{test.motion}"
            )
        standing[kind] = model
    hinges = test.structure.hinges
    left = [
        kind
        for kind, hinge in zip(test.kinds, hinges, strict=True)
        if hinge.law is UNKNOWN and kind not in standing
    ]
    if left:
        raise InputError(
            f"{test.name!r} has joints without a law ({', '.join(dict.fromkeys(left))}); give --model: what discover "
            "wrote of it, or a model.json"
        )
    laws = {kind: model_law(model) for kind, model in standing.items()}
    placed = tuple(
        replace(hinge, law=laws.get(kind, hinge.law)) for kind, hinge in zip(test.kinds, hinges, strict=True)
    )
    return replace(test.structure, hinges=placed), tuple(standing.get(kind) for kind in test.kinds)


def _kind_of(test: RigTest, model: JointModel, alone: bool) -> str:
    name = model.joint.name
    if name in test.kinds:
        return name
    without = dict.fromkeys(
        kind for kind, hinge in zip(test.kinds, test.structure.hinges, strict=True) if hinge.law is UNKNOWN
    )
    if alone and len(without) == 1:
        return next(iter(without))
    raise InputError(
        f"{test.name!r} has no joint of kind {name!r}, after which the model is named; it has "
        f"{', '.join(dict.fromkeys(test.kinds))}: write kind = {name!r} for those that it stands for"
    )
