"""The weak form of a joint's equation: what pysindy's test functions make of moving segments of force states.

Multiplied by a test function φ that vanishes at both ends of a segment and integrated over it, M − I·θ̈ = Σ cⱼ fⱼ(θ, θ̇)
becomes ∫φM dt + I·∫φ′θ̇ dt = Σ cⱼ·∫φfⱼ dt, without the acceleration. The joint must move throughout: where it sticks,
the moment is no function of (θ, θ̇).
"""

import warnings
from collections.abc import Sequence
from functools import lru_cache
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from sindyjoint.discovery.evidence import Evidence
from sindyjoint.discovery.rows import Rows, gather_columns, row_labels
from sindyjoint.equation.model import INERTIA
from sindyjoint.equation.terms import ResolvedTerm, term_columns
from sindyjoint.errors import InputError, MissingExtraError
from sindyjoint.limits import DISCOVERY
from sindyjoint.numeric import Array
from sindyjoint.states import ForceStates, group_labels


def weak_evidence(
    terms: Sequence[ResolvedTerm], states: Sequence[ForceStates], inertia: float | None
) -> Evidence:
    """Return the factors of a campaign's moment and terms in weak form, by run and replicate block.

    Parameters
    ----------
    terms : sequence of ResolvedTerm
    states : sequence of ForceStates
    inertia : float or None
        kg·m²; ``None``: the inertia is one of the terms.

    Raises
    ------
    InputError
        For a run without a moving segment that is long enough.
    MissingExtraError
        Where the installed pysindy has no weak library.
    """
    parts = [_run_rows(terms, state, inertia or 0.0) for state in states]
    sizes = [len(part[0]) for part in parts]
    columns, target, other, other_target, blocks = (np.concatenate(each) for each in zip(*parts, strict=True))
    groups = runs = None
    if len(states) > 1:
        groups = np.repeat(group_labels(states), sizes)
        runs = np.repeat([state.run for state in states], sizes)
    labels = row_labels(len(columns), groups, runs, blocks)
    return gather_columns(
        [term.id for term in terms], Rows(columns, target), labels, Rows(other, other_target)
    )


def integral_weights(samples: int, interval: float, seed: int = 0) -> tuple[Array, Array]:
    """Return weights w, v of evenly spaced samples: w @ f are the integrals ∫φf dt and v @ f the ∫φf′ dt = −∫φ′f dt.

    Parameters
    ----------
    samples : int
    interval : float
        s.
    seed : int
        Of the centres of the test functions.

    Returns
    -------
    ndarray, shape (K, samples), twice
    """
    import pysindy

    if not hasattr(pysindy, "WeakPDELibrary"):
        raise MissingExtraError(
            f"the weak form needs pysindy's WeakPDELibrary, which pysindy {version('pysindy')} does not have; "
            "leave 'weak' out"
        )
    # A unit impulse at each sample: what the library makes of them are its weights.
    impulses = np.eye(samples)
    before = np.random.get_state()
    # pysindy draws the centres from NumPy's global generator.
    np.random.seed(seed)
    try:
        with warnings.catch_warnings():
            # It labels the axes of its own grid one too many.
            warnings.simplefilter("ignore")
            # pysindy's default for the test functions (1 − s²)ᵖ.
            library = pysindy.WeakPDELibrary(
                function_library=pysindy.PolynomialLibrary(degree=1, include_bias=False),
                spatiotemporal_grid=interval * np.arange(samples),
                K=DISCOVERY.test_functions,
                H_xt=[DISCOVERY.test_half_width * interval * (samples - 1)],
                p=4,
            )
            weights = np.asarray(library.fit(impulses).transform(impulses))
            return weights, np.asarray(library.convert_u_dot_integral(impulses))
    finally:
        np.random.set_state(before)


_weights = lru_cache(maxsize=512)(integral_weights)


def _run_rows(
    terms: Sequence[ResolvedTerm], state: ForceStates, inertia: float
) -> tuple[Array, Array, Array, Array, NDArray[np.intp]]:
    """Return columns and target of a run in weak form, both once more as each block gives them, and the blocks."""
    motion = (state.angle, state.rate, state.acceleration)
    segments = [part for part in _moving_segments(state) if part.size >= DISCOVERY.shortest_segment]
    if not segments:
        raise InputError(
            f"run {state.run!r}: no segment of {DISCOVERY.shortest_segment} samples in which the joint moves one way, "
            "as the weak form needs; leave 'weak' out, or sample faster"
        )
    whole = _integrals(terms, motion, state, segments, inertia)
    other = whole if state.replicate is None else _integrals(
        terms, state.replicate, state, segments, inertia)  # fmt: skip
    blocks = np.repeat([state.block[part[0]] for part in segments], DISCOVERY.test_functions)
    return *whole, *other, blocks


def _integrals(
    terms: Sequence[ResolvedTerm],
    motion: tuple[Array, Array, Array],
    state: ForceStates,
    segments: Sequence[NDArray[np.intp]],
    inertia: float,
) -> tuple[Array, Array]:
    columns = term_columns(list(terms), *motion, inputs=state.inputs)
    by_parts = next((i for i, term in enumerate(terms) if term.id == INERTIA), None)
    rate, found, target = motion[1], [], []
    for part in segments:
        weights, slopes = _weights(part.size, 1.0 / state.sample_rate)
        integrals, accelerations = weights @ columns[part], slopes @ rate[part]
        if by_parts is not None:
            integrals[:, by_parts] = accelerations
        found.append(integrals)
        target.append(weights @ state.moment[part] - inertia * accelerations)
    return np.vstack(found), np.concatenate(target)


def _moving_segments(state: ForceStates) -> list[NDArray[np.intp]]:
    """Return the samples of each segment of one block in which the joint moves one way without a gap."""
    at = np.flatnonzero(state.moving)
    if not at.size:
        return []
    way, block = np.sign(state.rate[at]), state.block[at]
    ends = (np.diff(at) > 1) | (np.diff(way) != 0) | (np.diff(block) != 0)
    return np.split(at, np.flatnonzero(ends) + 1)
