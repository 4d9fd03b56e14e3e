"""The page of the reproduction in a real browser."""

import pytest


@pytest.fixture(scope="module")
def reproduction(browser, tmp_path_factory):
    """Return the page of a reproduction; made only where there is a browser to show it."""
    from tests.doors.asked import ask

    folder = tmp_path_factory.mktemp("reproduction") / "out"
    assert ask("reproduce", "--random-state", 4, "--out", folder, "--quiet").status == 0
    return folder / "report.html"


def test_the_page_reads_turns_narrow_and_prints(open_page, reproduction, picture_of):
    page = open_page(reproduction)
    picture_of(page, "reproduction.png", full_page=True)
    box = page.locator(".verdict").bounding_box()
    assert box["y"] + box["height"] < 800 and "within" in page.locator(".verdict").inner_text().lower()
    assert page.locator("figure svg").count() == 7
    assert page.locator("#table-1-table tbody tr").count() == 8
    page.locator("#table-1-table thead th").nth(1).locator("button").click()
    assert page.locator("#table-1-table thead th").nth(1).get_attribute("aria-sort") == "ascending"
    canvas = page.locator("#loops2d canvas")
    canvas.scroll_into_view_if_needed()
    page.locator("#loops2d canvas[data-shown='2']").wait_for()
    page.emulate_media(media="print")
    assert page.locator("figure svg").first.is_visible() and not page.locator(".bar").is_visible()
    narrow = open_page(reproduction, viewport={"width": 360, "height": 740}, color_scheme="dark")
    picture_of(narrow, "reproduction-narrow-dark.png")
    assert narrow.evaluate("document.documentElement.scrollWidth") <= 360
