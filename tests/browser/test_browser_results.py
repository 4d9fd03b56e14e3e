"""The pages of a verification, a diagnosis and a comparison in a real browser: same bones, same manners."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "reporting"))
from test_reporting_results import HOSTILES, MADE, ORIGIN, page_of, written  # noqa: E402

from sindyjoint.reporting.page import Blocks, Page, render, section  # noqa: E402
from sindyjoint.reporting.tables import TextTable  # noqa: E402


@pytest.fixture(scope="module", params=HOSTILES)
def page_path(request, tmp_path_factory):
    """Return one of the pages, of a joint whose name is an attack."""
    folder = tmp_path_factory.mktemp(request.param)
    html = page_of(request.param)
    if html is None:
        return written(HOSTILES[request.param](), folder / "out") / "report.html"
    path = folder / f"{request.param}.html"
    path.write_text(html, encoding="utf-8")
    return path


def test_page_reads_and_prints(open_page, page_path, picture_of):
    page = open_page(page_path)
    picture_of(page, f"{page_path.stem}-{page_path.parent.parent.name}.png", full_page=True)
    assert page.locator("h1").inner_text().startswith("<script>document.title='taken'</script>")
    assert page.title() != "taken"
    box = page.locator(".next").bounding_box()
    assert box["y"] + box["height"] < 800
    assert page.locator("figure svg").count() >= 2
    page.emulate_media(media="print")
    assert page.locator("figure svg").first.is_visible() and not page.locator(".bar").is_visible()


@pytest.mark.parametrize("name", ["verification", "diagnosis", "comparison"])
def test_the_answers_stand_above_the_fold(open_page, tmp_path, name):
    page_path = written(MADE[name](), tmp_path / "out") / "report.html"
    for width in (1280, 420):
        page = open_page(page_path, viewport={"width": width, "height": 800})
        # A comparison is its table, which begins below; terms of an own joint are held against no others.
        convincing = () if name == "comparison" else (".verdict", "#figure-lead svg")
        for part in (".answer", ".lights li", ".next li", *convincing):
            box = page.locator(part).last.bounding_box()
            assert box["y"] + box["height"] <= 800, f"{part} at {width}"


def test_narrow_and_dark(open_page, page_path):
    page = open_page(page_path, viewport={"width": 360, "height": 740}, color_scheme="dark")
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 24, 29)"


def test_on_a_desktop_nothing_is_scrolled_sideways(open_page, page_path):
    page = open_page(page_path, viewport={"width": 1440, "height": 900})
    wider = page.evaluate(
        """() => [...document.querySelectorAll("html, .scroll, figure")]
            .filter((e) => e.scrollWidth > e.clientWidth + 1).map((e) => e.innerText.slice(0, 60))"""
    )
    assert wider == []


def test_tables_sort_by_the_numbers_they_show(open_page, page_path):
    page = open_page(page_path)
    table = page.locator("table.sortable").first
    heading = table.locator("thead th").nth(1)
    heading.locator("button").click()
    assert heading.get_attribute("aria-sort") == "ascending"
    # Shown numbers, units and dashes included, are in order as numbers.
    order = page.evaluate(
        """() => {
            const cells = [...document.querySelectorAll("table.sortable tbody tr")].map((row) => row.cells[1]);
            return sortKeys(cells.slice(0, document.querySelector("table.sortable").tBodies[0].rows.length));
        }"""
    )
    assert order == sorted(order)


def test_numbers_are_read_from_what_is_shown(open_page, page_path):
    page = open_page(page_path)
    shown = ["5910 ± 40", "(−2.684 ± 0.012)·10⁹", "1.04 %", "−0.5", "+0.02 %", "stlsq", "(1.5 ± 0.1)·10⁻⁵"]
    read = page.evaluate("texts => texts.map((text) => shownNumber(text) ?? null)", shown)
    assert (
        read[:5] == [5910, -2.684e9, 1.04, -0.5, 0.02]
        and read[5] is None
        and read[6] == pytest.approx(1.5e-5)
    )


# Only a verification has curves over time.
@pytest.mark.parametrize("page_path", ["verification"], indirect=True)
def test_responses_are_drawn_over_each_other(open_page, page_path):
    page = open_page(page_path)
    canvas = page.locator("#loops2d canvas")
    canvas.scroll_into_view_if_needed()
    page.locator("#loops2d canvas[data-shown='2']").wait_for()
    page.locator("#loops2d [data-role=legend] button").last.click()
    assert canvas.get_attribute("data-shown") == "1"


def test_values_of_the_terms_of_a_structure_stand_on_a_phone(open_page, tmp_path):
    columns = ("Kind", "Term", "Symbol", "Of", "Value", "Unit", "95 % interval")
    rows = tuple(
        ("inter-panel hinge", name, symbol, of, "(−1.2340 ± 0.0012)·10⁵", "N·m/rad²", "−1.2364 to −1.2316")
        for name, symbol, of in (("quadratic stiffness", "k_2", "θ²"), ("Coulomb friction", "M_F", "sgn(θ̇)"))
    )
    table = Blocks({}, {}).table(TextTable("terms", "Terms by kind of joint", columns, rows, text=("Unit",)))
    page_path = tmp_path / "report.html"
    whole = Page("a rig", "joints", "a rig", "", (), (), (section("laws", "Laws", "Laws", table),))
    page_path.write_text(render(whole, ORIGIN, False), encoding="utf-8")
    page = open_page(page_path, viewport={"width": 390, "height": 844})
    boxes = [cell.bounding_box() for cell in page.locator("#terms-table td.whole").all()]
    assert len(boxes) == 2 and all(0 <= box["x"] and box["x"] + box["width"] <= 390 for box in boxes)
