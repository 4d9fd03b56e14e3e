"""Make the guide's pictures of the report page: sections of a page in a headless Chromium, with numbered callouts.

python docs/write_report_pictures.py          # needs playwright and a Chromium
"""

from __future__ import annotations

import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

from playwright.sync_api import sync_playwright

import sindyjoint

IMAGES = Path(__file__).parent / "images"

# Of each picture the section that it shows, and for each callout an element and the place in its box.
PICTURES: dict[str, tuple[str, tuple[tuple[str, float, float], ...]]] = {
    "report-first": (
        ".lead",
        (
            (".lead .kicker", 0.4, 0.5),
            (".lead .answer", 1.6, 0.5),
            (".lead .lights", 0.98, 0.2),
            (".lead .equation", 1.0, 0.5),
            (".lead .next", 0.98, 0.8),
            (".lead .hero svg", 0.97, 0.05),
            (".lead .facts", 0.3, 0.13),
        ),
    ),
    "report-terms": (
        "#terms",
        (
            ("#terms-table th:nth-child(4)", 0.35, 0.5),
            ("#terms-table th:nth-child(6)", 0.1, 0.5),
            ("#terms-table th:nth-child(7)", 0.1, 0.5),
            ("#terms .warnings", 0.55, 0.15),
        ),
    ),
    "report-map": (
        "#map",
        (
            ("#map3d .controls", 0.68, 0.5),
            ("#map3d canvas", 0.42, 0.45),
            ("#map3d canvas", 0.72, 0.22),
            ("#figure-map svg", 0.53, 0.06),
            ("#figure-map svg", 0.4, 0.7),
            ("#figure-map svg", 0.79, 0.83),
        ),
    ),
    "report-loops": (
        "#loops2d",
        (("#loops2d .controls", 0.5, 0.5), ("#loops2d canvas", 0.137, 0.72), ("#loops2d canvas", 0.6, 0.17)),
    ),
    "report-residual": (
        "#residual",
        (
            ("#figure-residual svg", 0.03, 0.02),
            ("#figure-residual svg", 0.57, 0.02),
            ("#figure-residual svg", 0.03, 0.52),
        ),
    ),
    "report-choice": (
        "#choice",
        (
            ("#figure-path svg", 0.17, 0.75),
            ("#figure-path svg", 0.78, 0.3),
            ("#figure-coefficients svg", 0.32, 0.2),
            ("#figure-covariance svg", 0.74, 0.03),
        ),
    ),
}

MARK = """([selector, x, y, number]) => {
    const box = document.querySelector(selector).getBoundingClientRect();
    const mark = document.createElement("div");
    mark.textContent = number;
    Object.assign(mark.style, {
        position: "absolute", zIndex: 99, width: "26px", height: "26px", borderRadius: "50%",
        font: "bold 16px/26px sans-serif", textAlign: "center", color: "white", background: "#c2185b",
        boxShadow: "0 0 0 2px white",
        left: `${scrollX + box.left + x * box.width - 13}px`, top: `${scrollY + box.top + y * box.height - 13}px`,
    });
    document.body.append(mark);
}"""


def example() -> sindyjoint.Campaign:
    """Return a virtual test of a hinge at three frequencies and three levels."""
    made = sindyjoint.simulate(frequencies=[3, 4, 5], levels=[0.9, 0.6, 0.4], rng=1)
    return replace(made, joint=replace(made.joint, name="bench hinge"))


def main() -> None:
    """Write the pictures."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        page_file = sindyjoint.discover(example()).report(folder) / "report.html"
        chromium = shutil.which("chromium") or playwright.chromium.executable_path
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(
            viewport={"width": 1080, "height": 900}, color_scheme="light", bypass_csp=True
        )
        page.goto(page_file.as_uri())
        page.wait_for_timeout(1000)
        page.add_style_tag(content=".bar { position: static !important } section, .widget { padding: 8px }")
        for name, (section, callouts) in PICTURES.items():
            for number, (selector, x, y) in enumerate(callouts, 1):
                page.evaluate(MARK, [selector, x, y, number])
            page.locator(section).screenshot(path=IMAGES / f"{name}.png")
        browser.close()


if __name__ == "__main__":
    main()
