"""What makes motion, first of all joint laws: the moment of a joint at an angle, a rate and an internal state.

A law is evaluated at (θ, θ̇, direction, z), where *direction* (−1 or +1) is the sense of slip, or of impending slip
at standstill. Coulomb friction is thereby set-valued: at zero rate the joint can transfer every
moment in ``[moment(θ, 0, −1, z), moment(θ, 0, +1, z)]``. A law stores no state; internal states go in as
arguments and their rates come out.

Nothing here knows how laws are discovered; a recovered law is simulated through the protocol of :class:`Law`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from sindyjoint.errors import InputError, refuse
from sindyjoint.hooks import fetched
from sindyjoint.numeric import Array

if TYPE_CHECKING:
    import sympy

    from sindyjoint.mechanics.kernels import CompiledLaw, ScalarLaw


__getattr__ = fetched(
    __name__,
    {
        "beam": "Beam rectangular_section",
        "excitation": "Actuator harmonic pulse sampled tones",
        "rig_file": "RigFile rig_path shipped_rigs",
        "rig_test": "RigRun RigTest Sensor UncertainNumber uncertain_numbers",
        "rig_test_file": "load_rig_structure load_rig_test",
        "rigs": "MeasuredResponse load_rig",
        "sensors": "Channel",
        "stickslip": "simulate simulate_many slip_direction transfer_moment",
        "structure": "Hinge LumpedMass Structure assemble craig_bampton",
        "transient": "respond",
        "virtual": "BEAM_INERTIA virtual_campaign",
        "virtual_rig": "presliding_law virtual_pulse_test with_laws with_loss_factor",
    },
)


class Law(ABC):
    """What a simulation asks of a law: its compiled form, and what follows from it.

    Attributes
    ----------
    inertia : float
        Moving inertia between the moment sensor and the joint, kg·m² (kg).
    n_states : int
        Number of internal states.
    softening_limit : (float, float)
        Angles between which the elastic moment rises, rad (m).
    softening_angle : float
        Symmetric measure of the same, rad (m).
    """

    inertia: float
    n_states: int = 0
    softening_limit: tuple[float, float]
    softening_angle: float = np.inf

    @abstractmethod
    def compiled(self) -> CompiledLaw:
        """Return the C function with its numbers, as the integrators call it."""

    def _take(self, law: Law, *names: str) -> None:
        for name in names:
            object.__setattr__(self, name, getattr(law, name))

    def _evaluate(self, angle: ArrayLike, rate: ArrayLike, direction: ArrayLike, state: Any) -> Array:
        from sindyjoint.mechanics.kernels import evaluate_law

        theta, omega, s = np.array(np.broadcast_arrays(angle, rate, direction), dtype=np.float64)
        z = np.zeros((self.n_states, theta.size)) if state is None else np.array(state, dtype=np.float64)
        out = np.empty((1 + self.n_states, theta.size))
        law, flat = self.compiled(), (theta.ravel(), omega.ravel(), s.ravel())
        evaluate_law(law.address, *flat, z.reshape(self.n_states, theta.size), law.numbers, out)
        return out.reshape(1 + self.n_states, *theta.shape)

    def moment(self, angle: ArrayLike, rate: ArrayLike, direction: ArrayLike, state: Any = None) -> Array:
        """Transfer moment, N·m (N)."""
        return self._evaluate(angle, rate, direction, state)[0]

    def friction_interval(self, angle: ArrayLike, rate: ArrayLike, state: Any = None) -> tuple[Array, Array]:
        """Middle and half width of the moments between the two directions of slip, N·m (N)."""
        up, down = (self.moment(angle, rate, side, state) for side in (1.0, -1.0))
        return (up + down) / 2, (up - down) / 2

    def state_rate(self, angle: ArrayLike, rate: ArrayLike, direction: ArrayLike, state: Any = None) -> Array:
        """Rates of the internal states, shape (n_states, n)."""
        return self._evaluate(angle, rate, direction, state)[1:]


@dataclass(frozen=True)
class PaperLaw(Law):
    """The paper's five-term law, c1·θ̇ + k1·θ + k2·θ² + k3·θ³ + M_F·sign θ̇ (its Eq. 6).

    Parameters
    ----------
    k1, k2, k3 : float
        Stiffness, N·m/rad, N·m/rad², N·m/rad³.
    c1 : float
        Linear damping, N·m·s/rad.
    M_F : float
        Coulomb friction moment, N·m; not negative.
    inertia : float
        Moving inertia between moment sensor and joint, kg·m².
    name : str

    Raises
    ------
    InputError
        For numbers that are not finite, negative friction or negative inertia.

    Examples
    --------
    >>> import sindyjoint
    >>> sindyjoint.INTER_PANEL.k1, sindyjoint.INTER_PANEL.M_F
    (6066.0, 1.867)
    >>> softer = sindyjoint.PaperLaw(k1=3000.0, M_F=1.0, inertia=0.02)
    >>> len(sindyjoint.simulate(softer, angle_limit=8e-4, frequencies=[4], duration=1.0).runs)
    3
    """

    k1: float
    k2: float = 0.0
    k3: float = 0.0
    c1: float = 0.0
    M_F: float = 0.0
    inertia: float = 0.02
    name: str = "joint"

    def __post_init__(self) -> None:
        numbers = {name: getattr(self, name) for name in ("k1", "k2", "k3", "c1", "M_F", "inertia")}
        refuse(
            (not np.isfinite(v), f"{name} is {v!r}; expected a finite number") for name, v in numbers.items()
        )
        refuse(
            (numbers[name] < 0, f"{name} is {numbers[name]!r}; expected a number that is not negative")
            for name in ("M_F", "inertia")
        )

    @property
    def parameters(self) -> Array:
        """(k1, k2, k3, c1, M_F) in SI."""
        return np.array([self.k1, self.k2, self.k3, self.c1, self.M_F])

    @cached_property
    def softening_limit(self) -> tuple[float, float]:  # type: ignore[override]
        """Angles where the tangent stiffness k1 + 2·k2·θ + 3·k3·θ² first vanishes on either side of zero, rad."""
        roots = np.roots([3 * self.k3, 2 * self.k2, self.k1])
        real = roots[np.abs(roots.imag) <= 1e-12 * np.abs(roots)].real
        return max(real[real < 0], default=-np.inf), min(real[real > 0], default=np.inf)

    @property
    def softening_angle(self) -> float:  # type: ignore[override]
        """The symmetric measure sqrt(k1/(3|k3|)) of the softening limit, rad; infinite without softening."""
        return float(np.sqrt(self.k1 / (-3 * self.k3))) if self.k3 < 0 < self.k1 else np.inf

    def compiled(self) -> CompiledLaw:
        """Compiled form, shared by every set of coefficients."""
        from sindyjoint.mechanics.kernels import PAPER_CALLBACK, CompiledLaw

        return CompiledLaw(PAPER_CALLBACK, self.parameters, 0)


# Averages over 3, 4, 5 and 6 Hz printed in the last but one row of the paper's Tables 1 and 2. The paper gives no
# inertia; 0.02 kg·m² is an assumption of the virtual tests.
INTER_PANEL = PaperLaw(6.066e3, -1.927e5, -2.684e9, 48.13, 1.867, name="inter-panel joint")
PANEL_ROOT = PaperLaw(1.171e4, -6.273e5, -7.425e9, 54.07, 2.191, name="panel root joint")


@dataclass(frozen=True)
class FunctionLaw(Law):
    """A law written as a plain Python function of scalars, compiled by numba on first use.

    Parameters
    ----------
    function : callable
        ``f(theta, omega, direction, state, parameters, out)``; writes the moment to ``out[0]`` and the rates of
        the internal states to ``out[1:]``.
    parameters : array_like
    n_states : int
    inertia : float
        kg·m² (kg).
    softening_limit : (float, float)

    Examples
    --------
    >>> import sindyjoint
    >>> def detent(theta, omega, direction, state, parameters, out):
    ...     out[0] = parameters[0] * np.sin(theta / parameters[1])
    >>> law = sindyjoint.FunctionLaw(detent, (0.15, 6e-5))
    >>> len(sindyjoint.simulate(hidden=law, frequencies=[4], duration=1.0, rng=0).runs)
    3
    """

    function: ScalarLaw
    parameters: tuple[float, ...] = ()
    n_states: int = 0
    inertia: float = 0.0
    softening_limit: tuple[float, float] = (-np.inf, np.inf)

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", tuple(float(value) for value in self.parameters))

    def compiled(self) -> CompiledLaw:
        """Compiled form; one compilation per function, whatever its parameters."""
        from sindyjoint.mechanics.kernels import CompiledLaw, callback_of

        return CompiledLaw(
            callback_of(self.function), np.array(self.parameters, dtype=np.float64), self.n_states
        )


@dataclass(frozen=True)
class FormulaLaw(Law):
    """A law written as sympy expressions, interpreted by the integrators (:mod:`sindyjoint.mechanics.kernels`).

    They have the functions that formulas of catalogues have. The symbols ``theta`` and ``omega`` are angle and rate,
    ``direction`` the sense of slip; ``sign(omega)`` is taken as ``direction`` and is thereby set-valued at standstill.
    All other symbols are states or parameters.

    Parameters
    ----------
    expression : sympy.Expr
        Transfer moment, N·m (N).
    parameters : mapping of str to float
    state_rates : mapping of str to sympy.Expr
        Name of each internal state and the expression of its rate.
    inertia : float
        kg·m² (kg).
    softening_limit : (float, float)

    Raises
    ------
    InputError
        When a symbol has no value.

    Examples
    --------
    >>> from sympy import Symbol, sign
    >>> c, w = Symbol("c"), Symbol("omega")
    >>> FormulaLaw(c * w + 2 * sign(w), {"c": 3.0}).moment([0.0], [0.0], [-1.0])
    array([-2.])
    """

    expression: sympy.Expr
    parameters: Mapping[str, float] = field(default_factory=dict)
    state_rates: Mapping[str, sympy.Expr] = field(default_factory=dict)
    inertia: float = 0.0
    softening_limit: tuple[float, float] = (-np.inf, np.inf)

    def __post_init__(self) -> None:
        known = {"theta", "omega", "direction", *self.parameters, *self.state_rates}
        used = _symbols_of((self.expression, *self.state_rates.values()))
        if not used <= known:
            raise InputError(
                f"the law {self.expression} uses {', '.join(sorted(used - known))} without a value; "
                f"give it in parameters (known: {', '.join(sorted(known))})"
            )

    @property
    def n_states(self) -> int:  # type: ignore[override]
        """Number of internal states."""
        return len(self.state_rates)

    def with_parameters(self, values: Mapping[str, float]) -> FormulaLaw:
        """Return the same formulas with other values of some parameters."""
        return replace(self, parameters={**self.parameters, **values})

    @cached_property
    def _interpreted(self) -> CompiledLaw:
        from sindyjoint.mechanics.kernels import interpreted_law, program_of_expressions

        formulas = (self.expression, *self.state_rates.values())
        program = program_of_expressions(formulas, tuple(self.state_rates), tuple(self.parameters))
        return interpreted_law(
            program, self.n_states, np.array([*self.parameters.values()], dtype=np.float64)
        )

    def compiled(self) -> CompiledLaw:
        """Form for the integrators; new formulas and parameter values need no compilation."""
        return self._interpreted


@lru_cache(maxsize=1024)
def _symbols_of(expressions: tuple[sympy.Expr, ...]) -> frozenset[str]:
    return frozenset(symbol.name for each in expressions for symbol in each.free_symbols)


@dataclass(frozen=True)
class SumLaw(Law):
    """The sum of two laws, states side by side. The inertia and the softening limit are those of the first."""

    first: Law
    second: Law

    def __post_init__(self) -> None:
        self._take(self.first, "inertia", "softening_limit", "softening_angle")
        object.__setattr__(self, "n_states", self.first.n_states + self.second.n_states)

    def compiled(self) -> CompiledLaw:
        """Compiled form; once both laws have theirs, there is nothing more to compile."""
        from sindyjoint.mechanics.kernels import sum_of

        return sum_of(self.first.compiled(), self.second.compiled())


@dataclass(frozen=True, eq=False)
class LawWithNumbers(Law):
    """A law with other parameters of its compiled form, and another inertia; nothing is compiled anew.

    Parameters
    ----------
    law : Law
    parameters : ndarray
    inertia : float
        kg·m² (kg).
    """

    law: Law
    parameters: Array
    inertia: float

    def __post_init__(self) -> None:
        self._take(self.law, "n_states", "softening_limit")

    def compiled(self) -> CompiledLaw:
        """Compiled form, that of the law."""
        form = self.law.compiled()
        numbers = form.numbers.copy()
        numbers[form.places] = self.parameters
        return replace(form, numbers=numbers)
