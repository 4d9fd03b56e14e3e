"""MuJoCo: a model (MJCF) of one hinge or slide joint that holds the law.

A joint of MuJoCo 3.7 has polynomials k1·θ + k2·θ² + k3·θ³ and c1·θ̇ + c2·θ̇·|θ̇| + c3·θ̇³, and friction as a
constraint, which creeps. Springs that yield are those of fixed tendons (4.0); a DC motor that is shorted is a Maxwell
branch, K²/L stiff and L/R slow, and one without a magnet holds LuGre's friction.
"""

from dataclasses import dataclass
from math import inf, sqrt
from xml.sax.saxutils import quoteattr

import numpy as np

from sindyjoint.equation.formula import variable_symbols
from sindyjoint.equation.model import JointModel, ModelTerm
from sindyjoint.export import Export
from sindyjoint.export.elements import (
    WORST_FIT,
    BoucWen,
    Gap,
    Kind,
    LuGre,
    Maxwell,
    Slider,
    speeds,
    written_as,
)
from sindyjoint.export.fidelity import (
    Cycles,
    Represented,
    Rows,
    ascii_line,
    comment,
    fidelity_table,
    filled_in,
    inertial_rows,
    left_out,
    preamble,
    words_of,
)
from sindyjoint.export.parts import Parts, steepness
from sindyjoint.numeric import Array

NEEDED = {"joint": "3.7", "tendon": "4.0"}


def export(model: JointModel) -> Export:
    """Write ``joint.xml``."""
    parts, cycles = Parts.of(model), Cycles.of(model)
    words = words_of(model)
    inertia = model.inertia or 1.0
    stiffness, _ = steepness(model)
    fast = [speeds(element, cycles) for element in model.elements]
    fastest = sqrt((stiffness + sum(k for k, _ in fast)) / inertia) + max((d for _, d in fast), default=0.0)
    # A tenth of the fastest time constant, and a millisecond at most.
    step = float(f"{min(0.1 / fastest if fastest else inf, 1e-3):.1g}")
    elastic = _Polynomial.of(parts.elastic, cycles, "angle")
    rates = _Polynomial.of(parts.rate, cycles, "rate")
    # The largest of a constraint that MuJoCo allows (mjMAXIMP): the closer to one, the less friction creeps.
    impedance = 0.9999
    creep = (1 - impedance) * step * max(rates.jump, 0.0) / inertia
    rows = {
        **elastic.rows(cycles, "joint, stiffness", words.angle),
        **rates.rows(cycles, "joint, damping", words.rate, creep),
        **left_out(
            parts.coupled,
            f"a joint of MuJoCo has no {words.moment} of {words.angle} and {words.rate} together",
        ),
        **inertial_rows(parts),
    }
    added, rows_of_elements = written_as(model, cycles, _way, "fixed tendon, springyield")
    table = fidelity_table(model, cycles, rows | rows_of_elements)
    tendons = [kind for _, kind in added if isinstance(kind, Slider | Gap)]
    motors = [kind for _, kind in added if not isinstance(kind, Slider | Gap)]
    version = NEEDED["tendon" if tendons else "joint"]
    creeps = (
        f"friction is a constraint and creeps instead of sticking: {creep:.3g} {words.angle_unit}/s under a "
        f"{words.moment} just below it, less in proportion, and with the step"
    )
    notes = [
        f"needs MuJoCo {version} or later; the {words.moment} on the joint is minus the one of the equation, as a "
        "passive force",
        f"step and integrator are as tested: {step:g} s, implicitfast; friction and sliders are of first order in it",
        *[creeps] * (rates.jump > 0),
        f"the body has the moving inertia of the test, {model.inertia:.6g} {words.inertia_unit}: in a structure, "
        "take joint, tendons and actuators alone"
        if model.inertia
        else f"the moving inertia is not known: replace 1 {words.inertia_unit} by that of the body",
        "nothing bounds the angle: beyond the tested range the polynomials go on, and may turn over",
    ]
    text = filled_in(
        "mujoco.xml.j2",
        name=quoteattr(ascii_line(model.joint.name)),
        head=_xml_comment(comment(preamble(model, "MuJoCo", table, notes), "")),
        rotation=model.joint.motion == "rotation",
        step=step,
        inertia=inertia,
        impedance=impedance,
        elastic=elastic,
        rates=rates,
        tendons=tendons,
        motors=motors,
    )
    return Export("mujoco", {"joint.xml": text}, table, tuple(notes))


@dataclass(frozen=True, eq=False)
class _Polynomial:
    """Terms of one variable as a polynomial of MuJoCo: [jump or constant, a, b, c], and what each term gives to it."""

    variable: str
    fits: tuple[tuple[ModelTerm, Array | None, bool], ...]

    @classmethod
    def of(
        cls, terms: tuple[ModelTerm, ...], cycles: Cycles, variable: str, powers: int = 4
    ) -> "_Polynomial":
        """Fit the terms; what is a power already stays exactly that, and what no polynomial is near has no share."""
        fits: list[tuple[ModelTerm, Array | None, bool]] = []
        columns = _basis(variable, getattr(cycles, variable))[4 - powers :][:, cycles.moving].T
        size = np.sqrt(np.mean(columns**2, axis=0))
        for term in terms:
            power, factor = _power(term, variable) or (-1, 0.0)
            if power >= 4 - powers:
                fits.append((term, factor * np.eye(4)[power], True))
                continue
            wanted = cycles.term(term)[cycles.moving]
            fit = np.linalg.lstsq(columns / size, wanted, rcond=None)[0] / size
            near = np.mean((columns @ fit - wanted) ** 2) < WORST_FIT**2 * np.mean(wanted**2)
            fits.append((term, np.concatenate([np.zeros(4 - powers), fit]) if near else None, False))
        found = cls(variable, tuple(fits))
        # No negative friction: without the jumps, then.
        return cls.of(terms, cycles, variable, 3) if variable == "rate" and found.jump < 0 else found

    @property
    def whole(self) -> Array:
        """The polynomial, shape (4,)."""
        return sum((share for _, share, _ in self.fits if share is not None), np.zeros(4))

    @property
    def jump(self) -> float:
        """Friction, or the constant moment."""
        return float(self.whole[0])

    def rows(self, cycles: Cycles, where: str, variable: str, creep: float = 0.0) -> Rows:
        basis = _basis(self.variable, getattr(cycles, self.variable))
        if creep:
            basis[0] = np.clip(cycles.rate / creep, -1.0, 1.0)
        missing = tuple(term for term, share, _ in self.fits if share is None)
        rows = left_out(missing, f"no cubic polynomial of the {variable} is near it")
        constant = {"rate": "joint, frictionloss; creeps instead of sticking", "angle": "actuator, bias"}
        for term, share, exact in self.fits:
            if share is not None:
                alone = np.count_nonzero(share) == 1 and share[0]
                how = constant[self.variable] if alone else f"{where} polynomial"
                how += "" if exact else " fitted over the tested range"
                rows[term.id] = Represented(how, np.tensordot(share, basis, 1))
        return rows


def _basis(variable: str, x: Array) -> Array:
    """Constant, a, b and c of a stiffness; jump, a, b and c of a damping, whose even power is antisymmetric."""
    if variable == "angle":
        return np.array([np.ones(x.shape), x, x**2, x**3])
    return np.array([np.sign(x), x, x * np.abs(x), x**3])


def _power(term: ModelTerm, variable: str) -> tuple[int, float] | None:
    """Which of the four columns a term is, and how often."""
    import sympy

    theta, omega, _ = variable_symbols()
    powers = (sympy.Integer(1), theta, theta**2, theta**3)
    if variable == "rate":
        powers = (sympy.sign(omega), omega, omega * sympy.Abs(omega), omega**3)
    factor, rest = term.expression.as_coeff_Mul()
    return (powers.index(rest), term.coefficient * float(factor)) if rest in powers else None


def _way(kind: Kind | None) -> str:
    """Return what MuJoCo has for a kind of element."""
    dahl = isinstance(kind, BoucWen) and kind.n == 1 and not kind.gamma
    ways = {
        BoucWen: "dcmotor, lugre without its rise" if dahl else "",
        Gap: "fixed tendon with a dead band, springyield",
        Maxwell: "dcmotor, shorted: its inductance is the spring",
        LuGre: "dcmotor, lugre",
    }
    return ways.get(type(kind), "")


def _xml_comment(text: str) -> str:
    r"""Return text as a comment of XML that nothing inside can end.

    Examples
    --------
    >>> _xml_comment("a --> b -- c")
    '<!--\na - -> b - - c\n-->'
    """
    while "--" in text:
        text = text.replace("--", "- -")
    return f"<!--\n{text.strip()}\n-->"
