"""How large a rig may be, so that it is simulated in minutes and its matrices can be solved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress

from sindyjoint.errors import InputError, SindyJointError
from sindyjoint.mechanics.beam import Beam
from sindyjoint.mechanics.structure import Item, Structure, assemble

# Matrices of a chain are full: a thousand elements are gigabytes and minutes, and a beam is exact with a few.
MOST_ELEMENTS, MOST_PARTS = 200, 100
MOST_ELEMENTS_OF_ALL = 600
MOST_STEPS = 10_000_000
# Beyond these, SI, nothing is a part of a structure, and matrices are no longer solved.
SMALLEST, LARGEST = 1e-12, 1e15


def check_sizes(items: Sequence[Item], times: Mapping[str, float], where: str) -> None:
    """Refuse what would take hours or all memory to simulate."""
    elements = sum(item.elements for item in items if isinstance(item, Beam))
    if elements > MOST_ELEMENTS_OF_ALL:
        raise InputError(f"{elements} elements in all; expected at most {MOST_ELEMENTS_OF_ALL}")
    for name, value in times.items():
        if not (SMALLEST < value < LARGEST):
            raise InputError(f"{where} {name} is {value:g} in SI; expected a positive number")
    steps = times["duration"] * max(1 / times["step"], times["sample_rate"])
    if steps > MOST_STEPS:
        raise InputError(
            f"{where}: {steps:.3g} steps of time; expected at most {MOST_STEPS:g}: a shorter duration, a lower "
            "sample_rate or a larger step"
        )


def solvable_structure(items: Sequence[Item], clamp_stiffness: float) -> Structure:
    """Return the assembled chain; refuse one that no computer can solve."""
    from numpy.linalg import LinAlgError

    try:
        structure = assemble(items, clamp_stiffness)
        # Whether it holds together is the business of who simulates it, with the law that its joints will have.
        with suppress(InputError):
            structure.frequencies(1, locked=True)
    except (LinAlgError, ArithmeticError, ValueError) as error:
        if isinstance(error, SindyJointError):
            raise
        raise InputError(
            f"the chain cannot be solved ({' '.join(str(error).split()):.80}); check lengths, stiffnesses and masses"
        ) from None
    return structure
