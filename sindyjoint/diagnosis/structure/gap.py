"""The response gap of a pulse test: how large, and where in time, amplitude and frequency it lies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.localisation import Place
from sindyjoint.numeric import main_frequency
from sindyjoint.response.oscillation import hilbert_envelope
from sindyjoint.response.run import rms

Array = NDArray[np.float64]

# A record ends, for a gap, where its swing is so many times the noise.
AUDIBLE = 3.0
# A region is told when it holds this share of the gap, and so much more than its share of the samples.
LEAST_SHARE, LEAST_EXCESS = 0.15, 1.3
MOST_PLACES = 5


@dataclass(frozen=True, eq=False)
class RecordGap:
    """A record beside its simulation before and after the effects were added.

    Parameters
    ----------
    name : str
        The output point, and the rig where the record is of another one.
    time, measured : ndarray, shape (n,)
        s, m.
    before : ndarray, shape (n,) or None
        Of the model as it was given; None where it could not be simulated.
    after : ndarray, shape (n,) or None
        With the effects, fitted to what was not held out.
    noise : float
        RMS, m.
    held_from : float
        Time from which the record was kept out of the fit of `after`, s.
    gap_before, gap_after, noise_floor : float
        Relative RMS over what was held out.
    """

    name: str
    time: Array
    measured: Array
    before: Array | None
    after: Array | None
    noise: float
    held_from: float
    gap_before: float
    gap_after: float
    noise_floor: float


def audible_end(measured: Array, sample_rate: float, noise: float) -> float:
    """Return the time at which a decay sinks into its noise, or the end of the record, s."""
    envelope, _ = hilbert_envelope(measured, sample_rate)
    loud = np.flatnonzero(envelope > AUDIBLE * noise)
    return float((loud[-1] + 1 if loud.size else measured.size) / sample_rate)


def relative_gap(measured: Array, simulated: Array | None, held: slice) -> float:
    """Return the RMS of simulated less measured over a part of a record, relative to the record's own there."""
    if simulated is None:
        return float("nan")
    own = float(np.std(measured[held]))
    return rms(simulated[held] - measured[held]) / own if own > 0 else float("nan")


def where(
    name: str, measured: Array, simulated: Array, sample_rate: float, noise: float, several: bool = False
) -> list[tuple[float, Place]]:
    """Return the regions that hold more of a record's gap than their share of it, each with its weight.

    Parameters
    ----------
    name : str
        Output point.
    measured, simulated : ndarray, shape (n,)
        m.
    sample_rate : float
        Hz.
    noise : float
        RMS, m.
    several : bool
        Whether there are other records, so that the words name the point.
    """
    left = simulated - measured
    power = np.maximum(left**2 - noise**2, 0.0)
    total = float(power.sum())
    if total <= 0:
        return []
    at = f" at {name}" if several else ""
    time = np.arange(measured.size) / sample_rate
    end = audible_end(measured, sample_rate, noise)
    envelope, _ = hilbert_envelope(measured, sample_rate)
    height = envelope / float(envelope.max())
    places: list[tuple[float, Place]] = []

    def add(axis: str, span: tuple[float, float] | str, words: str, share: float, rows: float) -> None:
        if 0 < rows < 0.95 and share > LEAST_SHARE and share > LEAST_EXCESS * rows:
            text = f"{words}{at}: {100 * share:.0f} % of the gap in {100 * rows:.0f} % of the record"
            places.append((share * float(np.log(share / rows)), Place(axis, span, share, text)))

    for low, high in zip((0.0, 0.05, 0.25, 0.5, 0.75), (0.05, 0.25, 0.5, 0.75, 1.0), strict=True):
        mask = (time >= low * end) & (time < high * end)
        add("time", (low * end, high * end), f"from {low * end:.3g} s to {high * end:.3g} s",
            float(power[mask].sum()) / total, float(mask.mean()))  # fmt: skip
    for low, high in ((0.0, 0.1), (0.1, 0.3), (0.3, 0.6), (0.6, 1.01)):
        mask = (height >= low) & (height < high)
        top = min(high, 1.0)
        add("amplitude", (low, top), f"while the swing is {100 * low:.0f} % to {100 * top:.0f} % of the largest",
            float(power[mask].sum()) / total, float(mask.mean()))  # fmt: skip
    places += _frequencies(left, measured, sample_rate, noise, at)
    place = _phase(simulated, measured, sample_rate, at)
    return [*places, *([place] if place else [])]


def _frequencies(
    left: Array, measured: Array, sample_rate: float, noise: float, at: str
) -> list[tuple[float, Place]]:
    """Return frequency bands whose share of the gap is larger than their share of the response."""
    main = main_frequency(measured, sample_rate)
    frequency = np.fft.rfftfreq(left.size, 1 / sample_rate)
    window = np.hanning(left.size)
    gap = np.maximum(np.abs(np.fft.rfft(left * window)) ** 2 - noise**2 * float(np.sum(window**2)), 0.0)
    own = np.abs(np.fft.rfft((measured - measured.mean()) * window)) ** 2
    found = []
    for low, high, words in (
        (0.0, 0.5, f"below {0.5 * main:.3g} Hz, under the main line"),
        (1.5, np.inf, f"above {1.5 * main:.3g} Hz, over the main line"),
    ):
        mask = (frequency >= low * main) & (frequency < high * main)
        share, rows = float(gap[mask].sum() / gap.sum()), float(own[mask].sum() / own.sum())
        if share > LEAST_SHARE and share > LEAST_EXCESS * rows:
            text = f"{words}{at}: {100 * share:.0f} % of the gap, {100 * rows:.0f} % of the response"
            span = (low * main, min(high * main, sample_rate / 2))
            found.append(
                (share * float(np.log(share / max(rows, 1e-3))), Place("frequency", span, share, text))
            )
    return found


def _phase(simulated: Array, measured: Array, sample_rate: float, at: str) -> tuple[float, Place] | None:
    """Return whether the gap is one of amplitudes or of periods.

    For the analytic signals S and M, |S − M|² = (|S| − |M|)² + 4·|S|·|M|·sin²(Δφ/2).
    """
    from scipy.signal import hilbert

    cut = round(sample_rate / main_frequency(measured, sample_rate))
    if measured.size < 4 * cut:
        return None
    mine, other = (hilbert(x - x.mean())[cut:-cut] for x in (simulated, measured))
    amplitude = float(np.sum((np.abs(mine) - np.abs(other)) ** 2))
    total = float(np.sum(np.abs(mine - other) ** 2))
    if not total > 0:
        return None
    for share, span, words in (
        (1 - amplitude / total, "period", "the periods differ, and with them the phase"),
        (amplitude / total, "amplitude", "the amplitudes differ"),
    ):
        if share > 0.65:
            return share * 0.5, Place("phase", span, share, f"{words}{at}: {100 * share:.0f} % of the gap")
    return None


def most(places: list[tuple[float, Place]]) -> tuple[Place, ...]:
    """Return the weightiest places, one of each axis."""
    ordered = sorted(places, key=lambda each: -each[0])
    first = {place.axis: place for _, place in reversed(ordered)}
    return tuple(place for _, place in ordered if first[place.axis] is place)[:MOST_PLACES]
