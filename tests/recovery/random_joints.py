"""Random joints and their virtual tests, drawn without any code of discovery: the referee of recovery.

Ranges: stiffness and damping ×/÷ 2 about the paper's inter-panel joint, softening limit 0.7–1.0 mrad, friction
15–45 % of the largest elastic moment, quadratic stiffness 1–10 % of the RMS moment on either side.
"""

from dataclasses import dataclass, replace

import numpy as np
import sympy

from sindyjoint import simulate as virtual_campaign
from sindyjoint.errors import SimulationError
from sindyjoint.mechanics import INTER_PANEL, FormulaLaw, PaperLaw, SumLaw, simulate
from sindyjoint.record import Campaign, Joint, Run
from tests.made_models import multisine, sweep

TRUE_IDS = (
    "linear_stiffness",
    "quadratic_stiffness",
    "cubic_stiffness",
    "linear_damping",
    "coulomb_friction",
)
DRIVES = ("moment", "rig", "displacement")


@dataclass(frozen=True)
class Plan:
    """One random joint and how it is tested."""

    seed: int
    law: PaperLaw
    drive: str
    frequencies: tuple
    levels: tuple
    sample_rate: float
    duration: float

    def campaign(self, noise, **options):
        """Return the virtual test; the noise's generator is the plan's own, whatever its level."""
        settings = dict(
            drive=self.drive,
            frequencies=self.frequencies,
            levels=self.levels,
            sample_rate=self.sample_rate,
            duration=self.duration,
            random_state=10_000 + self.seed,
            angle_limit=self.angle_limit,
        )
        return virtual_campaign(self.law, noise=noise, **{**settings, **options})

    @property
    def angle_limit(self):
        """The nearer softening limit: a quadratic term moves it on one side, and past it a joint snaps through."""
        return min(abs(end) for end in self.law.softening_limit)

    @property
    def truth(self):
        """Coefficients in the order of TRUE_IDS."""
        return np.array([self.law.k1, self.law.k2, self.law.k3, self.law.c1, self.law.M_F])

    def __str__(self):
        return (
            f"seed {self.seed}: {self.drive}, {len(self.frequencies)} frequencies × {len(self.levels)} levels "
            f"({', '.join(f'{level:.2f}' for level in self.levels)}), {self.sample_rate:g} Hz, {self.duration:g} s"
        )


def random_plan(seed, **fixed):
    """Draw a joint and its test; ``fixed`` overrides fields of the plan."""
    rng = np.random.default_rng(seed)
    k1 = INTER_PANEL.k1 * 2 ** rng.uniform(-1, 1)
    limit = rng.uniform(0.7e-3, 1.0e-3)
    k3 = -k1 / (3 * limit**2)
    c1 = INTER_PANEL.c1 * 2 ** rng.uniform(-1, 1)
    levels = np.sort([rng.uniform(0.85, 0.92), *rng.uniform(0.3, 0.8, rng.integers(1, 4))])[::-1]
    top = levels[0] * limit
    friction = rng.uniform(0.15, 0.45) * (k1 * top + k3 * top**3)
    frequencies = tuple(
        sorted(rng.choice([3.0, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0], rng.integers(3, 5), replace=False))
    )
    share = rng.choice([-1, 1]) * np.exp(rng.uniform(np.log(0.01), np.log(0.1)))
    k2 = share * _moment_rms(k1, k3, c1, friction, limit * levels, frequencies) / _square_rms(limit * levels)
    plan = dict(
        seed=seed,
        law=PaperLaw(k1, k2, k3, c1, friction, name=f"random joint {seed}"),
        drive=DRIVES[seed % 3],
        frequencies=tuple(float(f) for f in frequencies),
        levels=tuple(round(float(level), 3) for level in levels),
        sample_rate=float(rng.choice([500, 1000, 2000, 5000], p=[0.3, 0.4, 0.2, 0.1])),
        duration=float(rng.choice([5, 10])),
    )
    return Plan(**{**plan, **fixed})


def _square_rms(peaks):
    """RMS of θ² over sinusoidal runs of these peak angles."""
    return float(np.sqrt(np.mean(3 / 8 * np.asarray(peaks) ** 4)))


def _moment_rms(k1, k3, c1, friction, peaks, frequencies):
    """RMS moment over sinusoidal runs, k2 left out."""
    phase = 2 * np.pi * (np.arange(200) + 0.5) / 200
    squares = []
    for peak in peaks:
        for frequency in frequencies:
            theta, rate = peak * np.sin(phase), peak * 2 * np.pi * frequency * np.cos(phase)
            squares.append(np.mean((k1 * theta + k3 * theta**3 + c1 * rate + friction * np.sign(rate)) ** 2))
    return float(np.sqrt(np.mean(squares)))


def aperiodic_campaign(plan, noise, kind, runs=6, duration=10.0, hidden=None):
    """Return runs that do not repeat: multisines of 1 to 8 Hz or sweeps from 1 to 8 Hz, at two levels.

    ``hidden`` is a law that acts beside the joint's own. The moment is scaled until the largest angle is 0.88 or 0.6 of
    the softening limit.
    """
    rng = np.random.default_rng((20_000, plan.seed))
    law = plan.law if hidden is None else SumLaw(plan.law, hidden)
    made = []
    for index in range(runs):
        if kind == "multisine":
            lines = 1.0 + 7.0 * np.sort(rng.uniform(size=12))
            drive = multisine(np.ones(12), lines, 2 * np.pi * rng.uniform(size=12), duration)
        else:
            drive = sweep(1.0, *((1.0, 8.0) if index % 2 == 0 else (8.0, 1.0)), duration)
        target = (0.88, 0.6)[index % 2] * plan.angle_limit
        motion = _reaching(law, drive, target, duration, plan.sample_rate)
        channels = [
            signal + noise * np.sqrt(np.mean(signal**2)) * rng.normal(size=signal.size)
            for signal in (motion.moment, motion.angle)
        ]
        made.append(Run(f"{kind} {index}", *channels, plan.sample_rate, level=("high", "low")[index % 2]))
    return Campaign(Joint(name=plan.law.name, inertia=plan.law.inertia), tuple(made), simulated=True)


def _reaching(law, drive, target, duration, rate):
    """Return the motion under a drive scaled until its largest angle is the target, to 2 %, from below."""
    own = law.first if isinstance(law, SumLaw) else law
    low, high = 0.0, 4 * own.k1 * target + 4 * own.M_F
    reached = None
    for _ in range(40):
        middle = 0.5 * (low + high)
        try:
            motion = simulate(
                law, drive.scaled(middle), duration, rate, limits=(-1.05 * target, 1.05 * target)
            )
            peak = np.abs(motion.angle).max()
        except SimulationError:
            peak = np.inf
        if peak <= target:
            low, reached = middle, motion
            if peak > 0.98 * target:
                break
        else:
            high = middle
    return reached


def rising_stiffness(plan, noise, rise):
    """Return the campaign of a joint whose k1 grows by ``rise`` from the lowest to the highest frequency."""
    low, high = min(plan.frequencies), max(plan.frequencies)
    parts = []
    for index, frequency in enumerate(plan.frequencies):
        stiffer = replace(plan.law, k1=plan.law.k1 * (1 + rise * (frequency - low) / (high - low)))
        options = dict(frequencies=(frequency,), random_state=(10_000 + plan.seed, index))
        parts.append(replace(plan, law=stiffer).campaign(noise, angle_limit=plan.angle_limit, **options))
    return parts[0].with_runs(tuple(run for part in parts for run in part.runs))


def maxwell_campaign(plan, noise, stiffness, time):
    """Return the campaign of a joint with a Maxwell branch beside it: k_m in series with a damper k_m·τ."""
    branch = FormulaLaw(
        sympy.Symbol("q"), {"km": stiffness, "tau": time},
        {"q": sympy.Symbol("km") * sympy.Symbol("omega") - sympy.Symbol("q") / sympy.Symbol("tau")},
    )  # fmt: skip
    return plan.campaign(noise, hidden=branch)
