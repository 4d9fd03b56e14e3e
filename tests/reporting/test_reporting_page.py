"""The report page: self-contained, all text escaped, and reading as the golden file does."""

import math
import re
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import pytest
from handmade import HOSTILE, ORIGIN, TERMS, model, page_html, report_data

from sindyjoint.equation import ModelTerm, list_catalogues, load_catalogue
from sindyjoint.reporting import draw_all
from sindyjoint.reporting.mathml import mathml

GOLDEN = Path(__file__).resolve().parents[1] / "golden" / "report.txt"
# Elements that fetch, and attributes that name what to fetch.
FETCHING = {"src", "srcset", "poster", "data", "action", "formaction", "background", "ping"}


class Reader(HTMLParser):
    """What a reader sees: the words, line by line; and the tags with their attributes."""

    BLOCKS = {
        "p",
        "h1",
        "h2",
        "h3",
        "tr",
        "li",
        "dt",
        "dd",
        "caption",
        "figcaption",
        "summary",
        "math",
        "title",
        "section",
    }
    SILENT = {"script", "style", "svg", "math"}

    def __init__(self):
        super().__init__()
        self.tags, self.text, self._silent = [], [""], []

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag in self.SILENT:
            self._silent.append(tag)
        if tag in self.BLOCKS:
            self.text.append("")
        if tag in ("td", "th"):
            self.text[-1] += " | "

    def handle_endtag(self, tag):
        if self._silent and self._silent[-1] == tag:
            self._silent.pop()

    def handle_data(self, data):
        if not self._silent:
            self.text[-1] += data

    @property
    def lines(self):
        lines = (re.sub(r"\s+", " ", line).strip() for line in self.text)
        return [line for line in lines if line]


def read(html):
    reader = Reader()
    reader.feed(html)
    return reader


@pytest.fixture(scope="module")
def page():
    data = report_data()
    return page_html(data, ORIGIN, draw_all(data))


@pytest.fixture(scope="module")
def hostile():
    terms = [(*TERMS[0][:2], HOSTILE, *TERMS[0][3:]), *TERMS[1:]]
    data = report_data(name=HOSTILE, runs=(HOSTILE, HOSTILE + "2"), terms=terms, periodic=False)
    return page_html(data, ORIGIN, draw_all(data))


def test_text_is_the_golden_one(page):
    text = "\n".join(read(page).lines) + "\n"
    assert text == GOLDEN.read_text(encoding="utf-8"), (
        "if the new text reads well, write it to tests/golden/report.txt"
    )


def test_nothing_is_fetched(page):
    for tag, attributes in read(page).tags:
        assert tag not in ("link", "iframe", "object", "embed", "img", "audio", "video", "base"), tag
        assert not FETCHING & set(attributes), (tag, attributes)
        for name in ("href", "xlink:href"):
            target = attributes.get(name, "#")
            assert target.startswith(("#", "data:image/png;base64,")), (tag, target)
    assert not re.search(r"@import|url\((?!#)", page)
    policy = next(
        a["content"] for t, a in read(page).tags if a.get("http-equiv") == "Content-Security-Policy"
    )
    assert policy.startswith("default-src 'none'; img-src data:; ") and "script-src 'sha256-" in policy


def test_what_people_wrote_is_text(hostile):
    reader = read(hostile)
    kinds = [a.get("type") for t, a in reader.tags if t == "script"]
    assert kinds == ["application/json", None]
    assert not any(name.startswith("on") for _, attributes in reader.tags for name in attributes)
    assert "img" not in {tag for tag, _ in reader.tags}
    # Joint, both runs, and the term that a catalogue's author named so: shown as they are.
    shown = re.sub(r"\s+", " ", HOSTILE)
    assert sum(shown in line for line in reader.lines) >= 5
    assert "49" not in "".join(line for line in reader.lines if "7*7" in line).replace(shown, "")


def test_the_payload_cannot_leave_its_element(hostile):
    start = hostile.index('id="payload">') + len('id="payload">')
    payload = hostile[start : hostile.index("</script>", start)]
    assert "\\u003cscript\\u003e" in payload and "<" not in payload


def test_ids_are_unique(page):
    ids = [attributes["id"] for _, attributes in read(page).tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    links = {a["href"][1:] for t, a in read(page).tags if t == "a"}
    assert links <= set(ids)


def test_pictures_follow_the_pages_colours(page):
    drawings = page[page.index("<svg") : page.rindex("</svg>")]
    assert "var(--ink)" in drawings and "var(--rule)" in drawings
    assert "fill: #ffffff" not in drawings
    # What stands upon colours keeps its colour: the numbers in the correlation's dark and pale cells.
    assert "#fefefe" in drawings and "#1b1f25" in drawings


def test_every_table_has_caption_and_headings_and_every_picture_a_name(page):
    tags = [tag for tag, _ in read(page).tags]
    assert tags.count("table") == tags.count("caption") == tags.count("thead") >= 4
    assert all(a.get("aria-label") for t, a in read(page).tags if t == "svg")
    assert all("scope" in a for t, a in read(page).tags if t == "th")


def test_a_page_without_a_model_says_so():
    data = report_data(terms=[])
    text = read(page_html(data, ORIGIN, draw_all(data))).lines
    assert "no model No set of terms passed: these data give no model of this joint." in text


@pytest.mark.parametrize("motion", ["rotation", "translation"])
def test_every_term_of_every_library_is_typeset(motion):
    # One model with all of them: well-formed, and as many summands as terms.
    for summary in list_catalogues():
        catalogue = load_catalogue(summary.name)
        terms = tuple(
            ModelTerm(t.id, t.symbol, t.name, t.family, t.formula, tuple((name, 0.5) for name in t.symbols),
                      t.unit_for(motion), 1.0, 0.1, (0.8, 1.2), 0.1, tuple(each.name for each in t.inputs))
            for t in catalogue
        )  # fmt: skip
        whole = mathml(_with_terms(model(motion), terms))
        tree = ElementTree.fromstring(whole)
        declared = 1  # the inertia
        assert len([child for child in tree if child.tag == "mrow"]) == len(terms) + declared
        letters = {element.text for element in tree.iter("mi")}
        assert ("x" if motion == "translation" else "θ") in letters
        assert not letters & {"theta", "omega", "alpha", "ω"}


def test_a_symbol_cannot_leave_the_equation():
    terms = model(terms=[(TERMS[0][0], "k<script>_&", *TERMS[0][2:])])
    tree = ElementTree.fromstring(mathml(terms))
    assert "k<script>" in {element.text for element in tree.iter("mi")}


def test_numbers_that_are_not_known_are_dashes():
    from sindyjoint.reporting import number

    assert (number(None), number(math.nan), number(-0.5)) == ("–", "–", "−0.5")


@pytest.mark.parametrize(
    ("words", "written"),
    [
        ("half-cycles lag", "Half-cycles lag."),
        ("éclat", "Éclat."),
        ("k_m is 5 % off", "k_m is 5 % off."),
        ("c1: not determined", "c1: not determined."),
        ("run3.csv has gaps", "run3.csv has gaps."),
        ("", ""),
    ],
)
def test_a_sentence_begins_with_a_capital_but_a_symbol_or_an_id_stays(words, written):
    from sindyjoint.reporting.page import sentence

    assert sentence(words) == written


def _with_terms(law, terms):
    from dataclasses import replace

    covariance = tuple(tuple(0.01 if i == j else 0.0 for j in range(len(terms))) for i in range(len(terms)))
    return replace(law, terms=terms, covariance=covariance)
