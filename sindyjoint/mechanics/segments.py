"""Multiple shooting: a joint without restoring moment is restarted from the measured state at every segment."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sindyjoint.errors import InputError
from sindyjoint.mechanics.excitation import Interpolation, sampled
from sindyjoint.mechanics.laws import Law
from sindyjoint.mechanics.stickslip import Motion, simulate


def segment_starts(n_samples: int, sample_rate: float, window: float) -> list[int]:
    """Return the first sample of every segment; a remainder of fewer than four samples joins the last segment.

    Parameters
    ----------
    n_samples : int
    sample_rate : float
        Hz.
    window : float
        Length of a segment, s.

    Raises
    ------
    InputError
        For a segment of fewer than four samples.

    Examples
    --------
    >>> segment_starts(1002, 100.0, 5.0)
    [0, 500]
    """
    length = round(window * sample_rate)
    if length < 4:
        raise InputError(f"window is {window!r} s at {sample_rate!r} Hz; expected at least four samples")
    starts = list(range(0, n_samples, length))
    return starts[:-1] if len(starts) > 1 and n_samples - starts[-1] < 4 else starts


def simulate_segments(
    law: Law,
    moment: ArrayLike,
    sample_rate: float,
    window: float,
    initial: ArrayLike,
    *,
    interpolation: Interpolation = "linear",
    initial_state: ArrayLike | None = None,
    **options: Any,
) -> Motion:
    """Simulate a measured moment by multiple shooting: each segment restarts from a given state.

    A drive without restoring stiffness drifts; restarting keeps the comparison with a measurement meaningful.

    Parameters
    ----------
    law : Law
    moment : array_like, shape (n,)
        Measured moment, N·m (N).
    sample_rate : float
        Hz.
    window : float
        Length of a segment, s.
    initial : array_like, shape (n, 2)
        Measured angle and rate at every sample, from which each segment starts.
    interpolation : {"linear", "cubic", "hold"}
    initial_state : array_like, shape (n_states, n), optional
        Internal states at every sample.
    **options
        As in :func:`simulate_many`.

    Returns
    -------
    Motion
        One record of n samples, the segments one after another.
    """
    values, start = np.asarray(moment, dtype=np.float64), np.asarray(initial, dtype=np.float64)
    if start.shape != (values.size, 2):
        raise InputError(f"initial has shape {start.shape}; expected ({values.size}, 2), a state per sample")
    starts = segment_starts(values.size, sample_rate, window)
    ends = [*starts[1:], values.size]
    parts = []
    for a, b in zip(starts, ends, strict=True):
        z0 = None if initial_state is None else np.asarray(initial_state)[:, a]
        excitation = sampled(values[a:b], sample_rate, interpolation)
        parts.append(
            simulate(
                law,
                excitation,
                (b - a) / sample_rate,
                sample_rate,
                initial=start[a],
                initial_state=z0,
                **options,
            )
        )
    joined = {
        name: np.concatenate([getattr(part, name) for part in parts], axis=-1)
        for name in ("angle", "rate", "acceleration", "moment", "stuck", "state")
    }
    return Motion(
        time=np.arange(values.size) / sample_rate, **joined, steps=sum(part.steps for part in parts)
    )
