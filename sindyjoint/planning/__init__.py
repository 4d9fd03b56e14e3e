"""Which runs to make: what drives runs that could be made, how far they may go, and how the joint then moves."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, pi

import numpy as np

from sindyjoint.errors import InputError, SimulationError
from sindyjoint.hooks import fetched
from sindyjoint.limits import PLANNING, PlanningPolicy
from sindyjoint.mechanics import Law
from sindyjoint.mechanics.excitation import SINE, Actuator, Drive, driven_at, tones
from sindyjoint.mechanics.stickslip import Motion, prescribed_motion, simulate
from sindyjoint.mechanics.virtual import LEVELS, PHASE
from sindyjoint.numeric import Array
from sindyjoint.states import REPLICATES

__getattr__ = fetched(
    __name__,
    {
        "information": "Information Sensors changes_over_band half_widths run_information stacked",
        "plan": "plan_text play read_plan",
        "prior": "like_law like_model",
        "search": "Choice best_runs",
        "separating_runs": "rivals_of",
    },
)


POINTS = 400  # samples per period, at least


@dataclass(frozen=True)
class PlannedRun:
    """A run to be made.

    Parameters
    ----------
    drive : {"moment", "angle"}
    waveform : str
    frequency : float
        Hz.
    level : float
        Amplitude of what is prescribed, in ``unit``.
    unit : str
    duration : float
        s, the start-up included.
    """

    drive: Drive
    waveform: str
    frequency: float
    level: float
    unit: str
    duration: float


def motion(
    law: Law, drive: Drive, frequency: float, level: float, points: int = POINTS, waveform: str = SINE
) -> Motion:
    """Return how a joint moves from rest until it repeats.

    Raises
    ------
    SimulationError
        When it passes its softening limit, or does not repeat.
    """
    rate = points * frequency
    if drive == "angle":
        moved = prescribed_motion(law, tones(waveform, level, frequency, PHASE), 2 * points, rate)
        low, high = law.softening_limit
        if moved.angle.min() < low or moved.angle.max() > high:
            raise SimulationError("the prescribed angle passes the softening limit of the joint")
        return moved
    periods, most = 3, 48
    while periods <= most:
        moved = simulate(law, tones(waveform, level, frequency), periods / frequency, rate, rtol=1e-6)
        last, before = moved.angle[-points:], moved.angle[-2 * points : -points]
        if np.linalg.norm(last - before) <= PLANNING.granted_share * np.linalg.norm(last):
            return moved
        periods *= 2
    raise SimulationError(
        f"the joint does not repeat within {most} periods of {frequency:g} Hz under {level:.3g} N·m"
    )


def within_limits(law: Law, actuator: Actuator, frequency: float, level: float, waveform: str = SINE) -> bool:
    """Return whether a joint stays within the actuator's limits, and off its softening limit, from rest on."""
    try:
        moved = motion(law, actuator.drive, frequency, level, waveform=waveform)
    except SimulationError:
        return False
    low, high = (LEVELS[0] * end for end in law.softening_limit)
    return bool(
        low <= moved.angle.min()
        and moved.angle.max() <= high
        and np.abs(moved.angle).max() <= PLANNING.limit_share * actuator.angle
        and np.abs(moved.rate).max() <= PLANNING.limit_share * actuator.rate
        and np.abs(moved.moment).max() <= PLANNING.limit_share * actuator.moment
    )


def highest_level(laws: Sequence[Law], actuator: Actuator, frequency: float, waveform: str = SINE) -> float:
    """Return the highest amplitude that keeps every joint within the limits, N·m or rad.

    Raises
    ------
    InputError
        When every joint can be driven without end, so that there is no highest level.
    """
    level, guess = inf, _first_guess(laws, actuator, frequency)
    for law in laws:
        # Every further joint lowers the level, or is asked once.
        if level == inf or not within_limits(law, actuator, frequency, level, waveform):
            level = min(level, _highest_of(law, actuator, frequency, waveform, min(level, guess)))
    if level == inf:
        raise InputError(
            "no limit ends the levels: the joint does not soften; give the largest moment, angle or rate"
        )
    return level


def _highest_of(law: Law, actuator: Actuator, frequency: float, waveform: str, guess: float) -> float:
    """Return the highest amplitude that keeps one joint within the limits, from about ``guess`` on."""
    high, growth = guess, 1.5
    while within_limits(law, actuator, frequency, high, waveform):
        high *= growth
        if not high < 1e12:
            return inf
    low = high / growth
    while not within_limits(law, actuator, frequency, low, waveform):
        low, high = low / growth, low
        if low < 1e-9 * guess:
            raise InputError(f"no level at {frequency:g} Hz is within the limits")
    for _ in range(16):
        middle = 0.5 * (low + high)
        kept = within_limits(law, actuator, frequency, middle, waveform)
        low, high = (middle, high) if kept else (low, middle)
        if high - low < 1e-3 * low:
            break
    return low


def _first_guess(laws: Sequence[Law], actuator: Actuator, frequency: float) -> float:
    """Return about the highest level: by the limits, and the softening of the joints."""
    softening = min(min(abs(end) for end in law.softening_limit) for law in laws)
    angle = min(actuator.angle, actuator.rate / (2 * pi * frequency), softening)
    if actuator.drive == "angle":
        return angle if angle < inf else 1e-3
    if angle == inf:
        return actuator.moment if actuator.moment < inf else 1.0
    at = np.array([angle])
    return min(actuator.moment, min(float(law.moment(at, 0 * at, at / at)[0]) for law in laws))


def candidates(
    laws: Sequence[Law],
    middle: Law,
    actuator: Actuator,
    duration: float,
    unit: str,
    policy: PlanningPolicy = PLANNING,
    waveforms: Sequence[str] = (SINE,),
    say: Callable[[str], None] = lambda stage: None,
) -> tuple[tuple[PlannedRun, ...], tuple[PlannedRun, ...]]:
    """Return the runs to choose from, and the plain grid of three frequencies and three levels.

    Parameters
    ----------
    laws : sequence of Law
        Of the joints that must stay within the limits.
    middle : Law
        The joint whose angle the shares of the highest level refer to.
    actuator : Actuator
    duration : float
        Of each run, s.
    unit : str
        Of what is prescribed.
    policy : PlanningPolicy
    waveforms : sequence of str
        Among which is chosen; the grid is of sines.
    say : callable

    Raises
    ------
    InputError
        For a waveform that the band, or the duration, has no room for, and limits that no run keeps.
    """
    low, high = actuator.band
    plain = _rounded(np.linspace(low, high, 3 if high > low else 1))
    found, grid = [], []
    for waveform in dict.fromkeys((*waveforms, SINE)):
        within = set(_within_band(waveform, actuator, duration, policy)) if waveform in waveforms else set()
        for frequency in sorted({*within, *(plain if waveform == SINE else ())}):
            say(f"highest level at {frequency:g} Hz")
            top = highest_level(laws, actuator, frequency, waveform)
            level_of = _levels(middle, actuator.drive, frequency, top, waveform)
            made = [
                PlannedRun(actuator.drive, waveform, frequency, level_of(share), unit, duration)
                for share in policy.levels
            ]
            found += made if waveform in waveforms else []
            grid += made[::2] if waveform == SINE and frequency in plain else []
    return tuple(found), tuple(grid)


def _within_band(waveform: str, actuator: Actuator, duration: float, policy: PlanningPolicy) -> list[float]:
    """Return frequencies of a waveform, Hz, that drives within the band alone and repeats often enough in a run."""
    lowest, highest = driven_at(waveform)
    # A duration for the lowest sine is long enough for every other; the rest is for the rounding.
    least = max(actuator.band[0] / lowest, 1.005 * (REPLICATES + 1) / duration * (waveform != SINE))
    most = actuator.band[1] / highest
    if least > most * (1 + 1e-9):
        low, high = actuator.band
        raise InputError(
            f"waveform {waveform} drives from {lowest:g} to {highest:g} times the frequency at which it repeats, "
            f"{REPLICATES + 1} times in a run of {duration:.3g} s: no room for it from {low:g} to {high:g} "
            "Hz; expected a wider band, or longer runs"
        )
    count = policy.frequencies if most > least * (1 + 1e-9) else 1
    # The plain grid's are among them.
    return _rounded(np.linspace(least, max(most, least), count))


def _rounded(values: Array) -> list[float]:
    return [float(f"{value:.3g}") for value in values]


def _levels(
    law: Law, drive: Drive, frequency: float, top: float, waveform: str = SINE
) -> Callable[[float], float]:
    """Return what gives the level that moves a joint by a share of what the highest one does."""
    # The middle joint is simulated at these levels.
    levels = top * np.linspace(0.0, 1.0, 13)
    reached = levels
    if drive == "moment":
        # Friction holds the joint up to a level that is not small beside the highest.
        moved = np.array([0.0, *(_swing(law, frequency, x, waveform) for x in levels[1:])])
        known = np.isfinite(moved)
        levels, reached = levels[known], np.maximum.accumulate(moved[known])

    def level(share: float) -> float:
        found = float(np.interp(share * reached[-1], reached, levels))
        # Digits are cut off and never rounded up.
        step = 10.0 ** (np.floor(np.log10(found)) - 3)
        return float(f"{np.floor(found / step * (1 + 1e-12)) * step:.4g}")

    return level


def _swing(law: Law, frequency: float, level: float, waveform: str) -> float:
    """Return the largest angle under a moment, rad; NaN where the joint does not repeat."""
    try:
        return float(np.abs(motion(law, "moment", frequency, level, waveform=waveform).angle).max())
    except SimulationError:
        return float("nan")


def counted_runs(count: int, further: bool) -> str:
    """Return a number of runs in words."""
    return f"{count} {'further ' * further}run{'s' * (count != 1)}"
