"""What kind of element a part with internal states is, whatever its effect is called.

Elements come from catalogues that people edit, so they are known by what their formulas do, not by name: rates and
moments are evaluated at a few states and compared with those of the kind.

Springs in series with sliders, side by side, are the form in which most programs hold hysteresis. Where an element is
nothing that a program knows, a set of such pairs is fitted to its moment over the test cycles (Iwan 1966); what they
miss stands in the fidelity table.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from sindyjoint.equation.element import JointElement
from sindyjoint.equation.model import JointModel
from sindyjoint.export.fidelity import Cycles, Represented, Rows, column_moments, evaluated
from sindyjoint.export.parts import Curve
from sindyjoint.numeric import ROUNDING, Array

# A fit that misses more of an element, or of a term, than this share stands for nothing.
WORST_FIT = 0.5


@dataclass(frozen=True)
class Slider:
    """A spring in series with a slider (Jenkins): it slides where its spring is deflected by ``deflection``."""

    stiffness: float
    deflection: float


@dataclass(frozen=True)
class Gap:
    """A spring that acts beyond a gap, in series with a slider of the limit ``moment``."""

    moment: float
    gap: float
    ramp: float

    def curve(self, inside: float = 0.0) -> Curve:
        """Return deflections and moments of the spring alone, which goes on behind the ramp.

        Parameters
        ----------
        inside : float
            Slope inside the gap, as a share of the one of the ramp.
        """
        far, slope = self.gap + 2 * self.ramp, self.moment / self.ramp
        x = np.array([0.0, self.gap, far] if self.gap else [0.0, far])
        y = slope * (np.maximum(x - self.gap, 0.0) + inside * np.minimum(x, self.gap))
        return Curve(np.concatenate([-x[:0:-1], x]), np.concatenate([-y[:0:-1], y]))


@dataclass(frozen=True)
class Maxwell:
    """A spring in series with a dashpot: its moment decays in ``time``, s."""

    stiffness: float
    time: float


@dataclass(frozen=True)
class BoucWen:
    """ż = θ̇·(1 − |z|ⁿ·(β·sign(z·θ̇) + γ)); Dahl's law has n = 1 and γ = 0."""

    stiffness: float
    n: float
    beta: float
    gamma: float

    @property
    def deflection(self) -> float:
        """The scale of its state; the value that it comes to at a steady rate where γ is zero."""
        return float(self.beta ** (-1 / self.n))


@dataclass(frozen=True)
class LuGre:
    """ż = θ̇ − |θ̇|·z/(y·(1 + rise·exp(−(θ̇/rate)²)))."""

    stiffness: float
    deflection: float
    rise: float
    rate: float


Kind = Slider | Gap | Maxwell | BoucWen | LuGre


def kind_of(element: JointElement, cycles: Cycles) -> Kind | None:
    """Return what an element is made of; None for what is none of these.

    Parameters
    ----------
    element : JointElement
    cycles : Cycles
        Of its model: they say how large angle and rate are.
    """
    form = element.form
    if len(form.states) != 1 or len(form.columns) != 1 or not form.uses <= {form.states[0].name, *form.names}:
        return None
    angle, rate = float(np.abs(cycles.angle).max()), float(np.abs(cycles.rate).max())
    limit = float(form.limits(element.values)[0])
    found: list[Kind | None] = []
    if np.isfinite(limit):
        found = [_slider(element, limit, rate)] if limit > 0 else []
    else:
        # The moment has to be in proportion to the state.
        z = angle * np.array([-1.0, -0.1, 0.02, 0.3, 1.0])
        slope = _moment(element, z) / z
        if _same(slope, slope[0]):
            found = [
                recognise(element, float(slope[0]), angle, rate)
                for recognise in (_maxwell, _bouc_wen, _lugre)
            ]
    kind = next((kind for kind in found if kind is not None), None)
    # Its numbers free of the rounding of their recognition.
    return kind and type(kind)(*(float(f"{number:.12g}") for number in vars(kind).values()))


def written_as(
    model: JointModel, cycles: Cycles, way: Callable[[Kind | None], str], pair: str
) -> tuple[list[tuple[str, Kind]], Rows]:
    """Return what a program writes for each element, by id, and the rows of its table.

    Parameters
    ----------
    model : JointModel
    cycles : Cycles
    way : callable
        What the program calls a kind; empty for one that it has none of.
    pair : str
        What it calls a spring in series with a slider.
    """
    found: list[tuple[str, Kind]] = []
    rows: Rows = {}
    for element in model.elements:
        kind = kind_of(element, cycles)
        how = way(kind)
        # The first number of each is a stiffness, or the limit of a slider.
        if kind is not None and how and next(iter(vars(kind).values())) > 0:
            found.append((element.id, kind))
            rows[element.id] = Represented(how, cycles.element(element))
        else:
            sliders, rows[element.id] = _as_pairs(element, kind, cycles, pair)
            found += [(element.id, slider) for slider in sliders]
    return found, rows


def _as_pairs(
    element: JointElement, kind: Kind | None, cycles: Cycles, how: str
) -> tuple[list[Slider], Represented]:
    """Return an element as spring-slider pairs, and its row; none where they would miss too much of it."""
    if isinstance(kind, Slider) and kind.stiffness > 0:
        deflection = cycles.slider(np.full(cycles.angle.shape, kind.deflection), 1.0)
        return [kind], Represented(how, kind.stiffness * deflection)
    wanted = cycles.element(element)
    largest = float(np.abs(cycles.angle).max())
    # Deflections at which fitted sliders may yield, as shares of the tested angle; the last one never does.
    shares = (*np.geomspace(0.01, 1.0, 19), 3.0)
    yields = np.array([float(f"{largest * share:.4g}") for share in shares])
    columns = cycles.slider(np.broadcast_to(yields[:, None, None], (yields.size, *wanted.shape)), 1.0)
    stiffness, _ = scipy.optimize.nnls(columns.reshape(yields.size, -1).T, wanted.ravel())
    forces = stiffness * np.minimum(yields, yields[-2])
    # Pairs that carry less than this share of all are left out.
    kept = forces > 2e-3 * forces.sum()
    missed = np.inf
    if kept.any():
        columns = columns[kept]
        stiffness, _ = scipy.optimize.nnls(columns.reshape(len(columns), -1).T, wanted.ravel())
        missed = float(np.mean((np.tensordot(stiffness, columns, 1) - wanted) ** 2))
    if not missed < WORST_FIT**2 * np.mean(wanted**2):
        return [], Represented("not carried: it is too far from springs in series with sliders", None)
    stiffness = np.array([float(f"{k:.6g}") for k in stiffness])
    sliders = [Slider(float(k), float(y)) for k, y in zip(stiffness, yields[kept], strict=True) if k > 0]
    words = f"{len(sliders)} x {how}, fitted over the tested range"
    return sliders, Represented(words, np.tensordot(stiffness, columns, 1))


def state_rates(element: JointElement, angle: Array, rate: Array, states: Array) -> Array:
    """Return the rates of the internal states, shape (n_states, ...), without their limits."""
    return np.moveaxis(evaluated(element, [s.rate for s in element.form.states], angle, rate, states), -1, 0)


def speeds(element: JointElement, cycles: Cycles) -> tuple[float, float]:
    """Return the largest |∂M/∂z·∂ż/∂θ̇|, N·m/rad, and |∂ż/∂z|, 1/s, over the cycles: they bound a step's length."""
    states = cycles.states(element)
    angle, rate = cycles.angle, cycles.rate
    faster = state_rates(element, angle, 1.001 * rate, states) - state_rates(
        element, angle, 0.999 * rate, states
    )
    stiffness, relaxation = np.zeros(angle.shape), 0.0
    for j in range(len(states)):
        step = np.zeros(states.shape)
        step[j] = 1e-4 * max(float(np.abs(states[j]).max()), 1e-300)
        change = column_moments(element, angle, rate, states + step) - column_moments(
            element, angle, rate, states - step
        )
        slope = change @ element.coefficients / (2 * step[j])
        stiffness += np.abs(slope * faster[j] / (0.002 * rate))
        decay = state_rates(element, angle, rate, states + step) - state_rates(
            element, angle, rate, states - step
        )
        relaxation = max(relaxation, float(np.abs(decay[j] / (2 * step[j])).max()))
    # Rates and amplitudes somewhat beyond the tested ones are integrated well, too.
    return float(stiffness.max(initial=0.0)), 1.2 * relaxation


def _moment(element: JointElement, z: Array) -> Array:
    zero = np.zeros(z.shape)
    return np.asarray(column_moments(element, zero, zero, z[None]) @ element.coefficients)


def _rate(element: JointElement, rate: Array, z: Array) -> Array:
    return state_rates(element, np.zeros(rate.shape), rate, z[None])[0]


def _same(a: Array, b: Array | float) -> bool:
    scale = float(np.abs(a).max(initial=0.0)) or 1.0
    return bool(np.all(np.isfinite(a))) and bool(np.all(np.abs(a - b) <= ROUNDING * scale))


def _slider(element: JointElement, limit: float, rate: float) -> Slider | Gap | None:
    z = limit * np.linspace(-1, 1, 4001)
    omega = rate * np.linspace(-1, 1, z.size)
    if not _same(_rate(element, omega, z), omega):
        return None
    moment = _moment(element, z)
    top = float(moment[-1])
    if _same(moment, top / limit * z):
        return Slider(top / limit, limit)
    inside = np.abs(z[np.abs(moment) <= 0.5 * abs(top)]).max()
    # The upper half of the ramp says where it began: |M| = top·(|z| − gap)/ramp.
    low, high = (
        _moment(element, np.array([share * inside + (1 - share) * limit]))[0] for share in (0.5, 0.0)
    )
    if not high > low:
        return None
    ramp = top * 0.5 * (limit - inside) / (high - low)
    gap = limit - ramp
    expected = top * np.sign(z) * np.clip((np.abs(z) - gap) / ramp, 0, 1)
    return Gap(top, float(gap), float(ramp)) if 0 <= gap < limit and _same(moment, expected) else None


def _maxwell(element: JointElement, stiffness: float, angle: float, rate: float) -> Maxwell | None:
    z = angle * np.array([0.1, -0.5, 1.0, 0.7])
    omega = rate * np.array([1.0, -0.3, 0.0, 0.2])
    decay = (omega - _rate(element, omega, z)) / z
    return Maxwell(stiffness, 1 / float(decay[0])) if _same(decay, decay[0]) and decay[0] > 0 else None


def _bouc_wen(element: JointElement, stiffness: float, angle: float, rate: float) -> BoucWen | None:
    z = angle * np.array([0.5, 1.0, 0.25, 0.8])

    def defect(sense: float) -> Array:
        omega = sense * rate * np.array([1.0, 0.3, 0.1, 0.05])
        return 1 - _rate(element, omega, z) / omega

    ahead, back = defect(1.0), defect(-1.0)
    beta, gamma = (ahead - back) / 2, (ahead + back) / 2
    gamma = np.where(np.abs(gamma) < ROUNDING * np.abs(beta), 0.0, gamma)
    if not beta[1] > 0:
        return None
    n = round(float(np.log(beta[1] / beta[0]) / np.log(2)), 9)
    power = (z / angle) ** n
    fits = _same(ahead, ahead[1] * power) and _same(back, back[1] * power)
    other = 1 - _rate(element, np.array([rate, -rate]), np.array([-angle, -angle])) / np.array([rate, -rate])
    if not fits or n <= 0 or not _same(other, np.array([back[1], ahead[1]])):
        return None
    return BoucWen(stiffness, n, float(beta[1]) / angle**n, float(gamma[1]) / angle**n)


def _lugre(element: JointElement, stiffness: float, angle: float, rate: float) -> LuGre | None:
    def level(omega: Array, z: float) -> Array:
        deflection = np.full(omega.shape, z)
        decay = omega - _rate(element, omega, deflection)
        # Where nothing decays the division is of no use, and the answer is none.
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.abs(omega) * deflection / decay

    slow, fast = level(np.array([1e-9, 1e6]) * rate, angle)
    rise = float(slow / fast) - 1
    if not (np.isfinite(rise) and fast > 0 and rise > 0):
        return None
    omega = rate * np.geomspace(1e-3, 3, 60)
    excess = (level(omega, angle) / fast - 1) / rise
    near = int(np.argmin(np.abs(excess - 0.5)))
    if not 0 < excess[near] < 1:
        return None
    width = float(omega[near] / np.sqrt(-np.log(excess[near])))
    samples = np.concatenate([-omega[::7], omega])
    expected = fast * (1 + rise * np.exp(-((samples / width) ** 2)))
    same = [np.allclose(level(samples, z), expected, rtol=1e-6) for z in (angle, -0.3 * angle)]
    return LuGre(stiffness, float(fast), rise, width) if all(same) else None
