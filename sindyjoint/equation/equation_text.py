"""The equation of a joint on one line: as text, as LaTeX, in whatever else writes formulas."""

import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from sindyjoint.equation.element import Column, JointElement
from sindyjoint.equation.formula import formula_latex, formula_pretty, state_symbol
from sindyjoint.equation.model_parts import INERTIA, ModelTerm
from sindyjoint.record import Joint


@dataclass(frozen=True)
class Style:
    """How an equation is written.

    Parameters
    ----------
    formula : callable
        Of an expression and the kind of motion.
    symbol : callable
        Of the name of a coefficient or a state.
    times : str
        Between a coefficient and its formula.
    inertia : (str, str)
        The part of a declared inertia, of rotation and of translation.
    rate, limit : str
        Of a state, its rate and its limit; of a state and the value that it cannot pass.
    between : str
        Of the equation and the rates.
    whole, plus, factor, none : str
        Of the load and what it is; between its parts; of what is multiplied as a whole; what stands for no part.
    loads : (str, str)
        Moment, and force.
    """

    formula: Callable[[Any, str], str]
    symbol: Callable[[str], str]
    times: str
    inertia: tuple[str, str]
    rate: str
    limit: str
    between: str
    whole: str = "{} = {}"
    plus: str = " + "
    factor: str = "({})"
    none: str = "0"
    loads: tuple[str, str] = ("M", "F")

    def product(self, symbol: str, expression: Any, motion: str) -> str:
        """Return a coefficient times its formula."""
        letter, formula = self.symbol(symbol), self.formula(expression, motion)
        if expression == 1 or formula == "1":
            return letter
        # A sum, and a formula that begins with a sign, are no factors as they stand.
        sum_or_sign = expression.is_Add or re.match(r"(<m\w+>)*[-−]", formula)
        return f"{letter}{self.times}{self.factor.format(formula) if sum_or_sign else formula}"

    def rate_of(self, name: str, rate: Any, limit: Any, motion: str) -> str:
        """Return the rate of an internal state, and the value that it cannot pass."""
        state = self.symbol(name)
        bound = "" if limit is None else self.limit.format(state, self.formula(limit, motion))
        return self.rate.format(state, self.formula(rate, motion), bound)

    def equation(
        self,
        joint: Joint,
        terms: Sequence[ModelTerm],
        elements: Sequence[JointElement] = (),
        further: Sequence[str] = (),
    ) -> str:
        """Return the equation, ``further`` parts in it; rates of internal states, and their limits, stand behind."""
        motion, slides = joint.motion, joint.motion == "translation"
        parts = [self.inertia[slides]] if joint.inertia else []
        # Inertia first, as the field writes it.
        ordered = sorted(terms, key=lambda term: term.id != INERTIA)
        parts += [self.product(term.symbol, term.expression, motion) for term in ordered]
        rates = []
        for each, written in zip(elements, numbered(elements), strict=True):
            columns, states = renamed(each, written)
            parts += [self.product(c.symbol, c.expression, motion) for c in columns]
            rates += [self.rate_of(*state, motion) for state in states]
        right = self.plus.join([*parts, *further]) or self.none
        return self.between.join([self.whole.format(self.loads[slides], right), *rates])


def numbered(elements: Sequence[JointElement]) -> list[dict[str, str]]:
    """Return how the states of each element are written where several elements stand side by side: z1, z2."""
    count = Counter(state.name for element in elements for state in element.states)
    following = {name: iter(range(1, n + 1)) for name, n in count.items()}
    return [
        {
            s.name: f"{s.name}{next(following[s.name])}" if count[s.name] > 1 else s.name
            for s in element.states
        }
        for element in elements
    ]


def renamed(
    element: JointElement, written: Mapping[str, str]
) -> tuple[list[Column], list[tuple[str, Any, Any]]]:
    """Return columns, and name, rate and limit of each state, with the states' names as they are written."""
    form, other = element.form, {state_symbol(name): state_symbol(new) for name, new in written.items()}
    columns = [replace(c, expression=c.expression.xreplace(other)) for c in form.columns]
    states = [
        (written[s.name], s.rate.xreplace(other), None if s.limit is None else s.limit.xreplace(other))
        for s in form.states
    ]
    return columns, states


_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)?", re.ASCII)
_SPECIAL = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": r"\textless{}", ">": r"\textgreater{}",
    "|": r"\textbar{}", '"': r"\textquotedbl{}",
}  # fmt: skip


def one_line(text: str) -> str:
    r"""Return text on one line, without control characters and halves of characters.

    Examples
    --------
    >>> one_line("left\r\n*STEP\x00 joint")
    'left *STEP joint'
    """
    clean = "".join(
        " " if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Cn", "Zl", "Zp") else c for c in str(text)
    )
    return " ".join(clean.split())


def latex_text(text: str) -> str:
    r"""Return text that LaTeX prints as it stands.

    Examples
    --------
    >>> print(latex_text("50% of A_1 & {B}"))
    50\% of A\_1 \& \{B\}
    """
    return "".join(_SPECIAL.get(c, c) for c in one_line(text))


def latex_symbol(symbol: str) -> str:
    r"""Return k1 as k_{1}, M_F as M_{F} and mu_a as \mu_{a}; what is no plain name as text."""
    from sympy.core.alphabets import greeks

    if not _PLAIN.fullmatch(symbol):
        return rf"\text{{{latex_text(symbol)}}}"
    head, _, tail = symbol.partition("_")
    if not tail and len(head) > 1 and head not in greeks:
        head, tail = head[0], head[1:]
    head, tail = (f"\\{part}" if part in greeks else part for part in (head, tail))
    return f"{head}_{{{tail}}}" if tail else head


PLAIN = Style(formula_pretty, str, "·", ("I·θ̈", "m·ẍ"), "d{}/dt = {}{}", " with |{}| ≤ {}", "; ")
LATEX = Style(
    formula_latex, latex_symbol, r"\,", (r"I\,\ddot{\theta}", r"m\,\ddot{x}"), r"\dot{{{}}} = {}{}", r",\ |{}| \leq {}",
    r",\quad ",
)  # fmt: skip
