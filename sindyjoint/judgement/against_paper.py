"""What a choice of terms is held against: the paper's terms that the data can show, at each level of the inputs."""

from __future__ import annotations

from dataclasses import replace

from sindyjoint.equation.candidates import rate_free
from sindyjoint.equation.catalogue import load_catalogue
from sindyjoint.judgement.at_each_level import changed_term
from sindyjoint.judgement.comparison import Choice
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.paper import TERMS as PAPER_TERMS


def wanted_terms(found: Discovery) -> tuple[str, ...]:
    """Return the paper's terms that the samples can show."""
    without_time = found.campaign.quasi_static
    paper = rate_free(load_catalogue("paper")).ids if without_time else PAPER_TERMS
    return tuple(term for term in PAPER_TERMS if term in paper)


def against_paper(found: Discovery, choice: Choice) -> Choice:
    """Return a choice that knows which terms of the paper it is held against, and which of its own change those."""
    changes = {
        item.id: changed_term(item.term.expression) for item in found.regressor.terms_ if item.term.inputs
    }
    own = tuple((name, term) for name in choice.ids if (term := changes.get(name)) is not None)
    return replace(choice, wanted=wanted_terms(found), dependences=own)
