"""A browser, the pages, and a folder for pictures; without a browser the tests skip and say so.

SINDYJOINT_BROWSER names a browser that is not on the path; SINDYJOINT_SCREENSHOTS a folder in which pictures are kept
for eyes.

Tests wait with locators, never with `page.wait_for_function`: a condition in the page is evaluated there, and where it
does not hold at once, the page's policy refuses the second look.
"""

import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

HOSTILE = (
    "hinge <img src=x onerror=\"document.title='taken'\"><script>document.title='taken'</script> & $x^2$"
)
NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")


@pytest.fixture(scope="session")
def hostile_name():
    return HOSTILE


@pytest.fixture(scope="session")
def browser():
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: no browser tests")
    executable = os.environ.get("SINDYJOINT_BROWSER") or next(filter(None, map(shutil.which, NAMES)), None)
    with api.sync_playwright() as playwright:
        executable = executable or playwright.chromium.executable_path
        if not Path(executable).exists():
            pytest.skip("no Chromium on this machine: no browser tests")
        quiet = [
            "--no-sandbox",
            "--disable-gpu",
            "--disable-background-networking",
            "--disable-component-update",
        ]
        started = playwright.chromium.launch(executable_path=executable, args=quiet)
        yield started
        started.close()


@pytest.fixture(scope="session")
def report(tmp_path_factory):
    """Return the report of a small virtual campaign of a joint whose name is an attack."""
    from sindyjoint import discover, simulate
    from sindyjoint.reporting import write_results

    campaign = simulate("inter-panel", frequencies=[3, 4, 6], levels=[0.9, 0.5], duration=3, random_state=5)
    hostile = replace(campaign, joint=replace(campaign.joint, name=HOSTILE))
    return write_results(discover(hostile), tmp_path_factory.mktemp("browser")) / "report.html"


@pytest.fixture(scope="session")
def picture_of():
    """Return a function that keeps a picture of a page or of a part of it in SINDYJOINT_SCREENSHOTS, where that is."""
    kept = os.environ.get("SINDYJOINT_SCREENSHOTS")

    def keep(shown, name, **options):
        if kept:
            Path(kept).mkdir(parents=True, exist_ok=True)
            shown.screenshot(path=Path(kept) / name, **options)

    return keep


@pytest.fixture
def open_page(browser, report):
    """Return a function that opens the report; afterwards nothing was fetched and the console is silent."""
    contexts, heard, asked = [], [], []

    def open_(path=report, **settings):
        context = browser.new_context(**{"viewport": {"width": 1100, "height": 800}, **settings})
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: heard.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: heard.append(f"error: {error}"))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(path.as_uri())
        return page

    yield open_
    for context in contexts:
        context.close()
    assert heard == []
    assert [url for url in asked if not url.startswith(("file:///", "data:"))] == []
    assert len([url for url in asked if url.startswith("file:")]) == len(contexts)
