"""The report page in a real browser. Every test also checks that the console is silent and nothing is fetched."""

import hashlib


def colours_of(page, selector):
    """Return how many different colours a canvas shows."""
    return page.evaluate(
        """selector => {
            const canvas = document.querySelector(selector);
            const image = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
            return new Set(new Uint32Array(image.data.buffer)).size;
        }""",
        selector,
    )


def picture(locator):
    return hashlib.sha256(locator.screenshot()).hexdigest()


def luminance(page, selector="body", what="backgroundColor"):
    """Return the luminance, 0 to 1, of a colour of an element as drawn."""
    text = page.evaluate("([s, w]) => getComputedStyle(document.querySelector(s))[w]", [selector, what])
    red, green, blue = (int(part) / 255 for part in text[4:-1].split(",")[:3])
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def test_the_verdict_is_in_the_first_screen(open_page, picture_of):
    page = open_page()
    picture_of(page, "whole-page.png", full_page=True)
    for width in (1280, 420):
        page.set_viewport_size({"width": width, "height": 800})
        picture_of(page, f"first-screen-{width}.png")
        # Verdict, equation, the picture that convinces, and the next step.
        for selector in (".answer", ".lights", ".equation math", ".hero svg", ".next"):
            box = page.locator(selector).bounding_box()
            assert box["y"] >= 0 and box["y"] + box["height"] < 800, (selector, width)
    assert page.locator(".lights li").count() == 4
    # Nobody who has a joint of their own need know of the paper.
    assert "paper" not in page.locator("main").inner_text().lower()


def test_it_is_light(open_page, report):
    # What a browser opens in well under two seconds: bytes and elements, which no other work on a machine changes.
    page = open_page()
    assert report.stat().st_size < 1_000_000
    assert page.evaluate("document.getElementsByTagName('*').length") < 9000


def test_a_hostile_name_is_text(open_page, hostile_name):
    page = open_page()
    assert page.locator("h1").inner_text() == hostile_name
    assert page.title() == f"{hostile_name}: terms of the joint"
    assert page.locator("img").count() == 0


def test_an_injected_script_would_not_run(browser, report, tmp_path):
    # Belt and braces: a script that got into the page all the same would be refused by the page's policy.
    broken = tmp_path / "broken.html"
    text = report.read_text(encoding="utf-8").replace("<main", "<script>window.taken = 1</script><main", 1)
    broken.write_text(text, encoding="utf-8")
    page = browser.new_page()
    heard = []
    page.on("console", lambda message: heard.append(message.text))
    page.goto(broken.as_uri())
    assert page.evaluate("window.taken") is None
    assert any("Content Security Policy" in message for message in heard)
    page.close()


def test_the_map_is_drawn_and_turned(open_page, picture_of):
    page = open_page()
    canvas = page.locator("#map3d canvas")
    canvas.scroll_into_view_if_needed()
    page.locator("#map3d canvas[data-faces]:not([data-faces='0'])").wait_for()
    assert int(canvas.get_attribute("data-faces")) > 100
    assert colours_of(page, "#map3d canvas") > 50
    picture_of(page.locator("#map3d"), "map.png")
    seen, view = picture(canvas), canvas.get_attribute("data-view")
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + 300, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 420, box["y"] + 170, steps=4)
    page.mouse.up()
    turned = picture(canvas)
    assert turned != seen and canvas.get_attribute("data-view") != view
    picture_of(page.locator("#map3d"), "map-turned.png")
    page.locator('#map3d [data-role="reset"]').click()
    assert canvas.get_attribute("data-view") == view


def test_the_map_by_keyboard_and_its_switches(open_page):
    page = open_page()
    canvas = page.locator("#map3d canvas")
    canvas.focus()
    views = [canvas.get_attribute("data-view")]
    for key in ("ArrowLeft", "ArrowUp", "+", "Home"):
        page.keyboard.press(key)
        views.append(canvas.get_attribute("data-view"))
    assert len(set(views)) == 4 and views[-1] == views[0]
    both = int(canvas.get_attribute("data-faces"))
    page.locator('#map3d [data-role="model"]').uncheck()
    cells = int(canvas.get_attribute("data-faces"))
    page.locator('#map3d [data-role="cells"]').uncheck()
    assert 0 < cells < both and canvas.get_attribute("data-faces") == "0"


def test_pointing_at_a_cell_reads_it(open_page):
    page = open_page()
    canvas = page.locator("#map3d canvas")
    canvas.scroll_into_view_if_needed()
    readout = page.locator("#map3d-read")
    before = readout.inner_text()
    box = canvas.bounding_box()
    for step in range(120):
        page.mouse.move(
            box["x"] + box["width"] * (0.3 + 0.4 * (step % 12) / 12), box["y"] + 60 + 25 * (step // 12)
        )
        if readout.inner_text() != before:
            break
    assert "samples, residual" in readout.inner_text() and "mrad" in readout.inner_text()


def test_loops_are_chosen_hidden_zoomed_and_read(open_page, picture_of):
    page = open_page()
    canvas = page.locator("#loops2d canvas")
    canvas.scroll_into_view_if_needed()
    page.locator("#loops2d canvas[data-shown='2']").wait_for()
    picture_of(page.locator("#loops2d"), "loops.png")
    page.locator("#loops2d [data-role=group]").select_option("all")
    assert canvas.get_attribute("data-shown") == "6"
    page.locator("#loops2d [data-role=legend] button").first.click()
    assert canvas.get_attribute("data-shown") == "5"
    whole = canvas.get_attribute("data-box")
    page.locator("#loops2d [data-role=in]").click()
    assert canvas.get_attribute("data-box") != whole
    canvas.dblclick()
    assert canvas.get_attribute("data-box") == whole
    box = canvas.bounding_box()
    for step in range(80):
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 20 + 4 * step)
        if "Hz" in page.locator("#loops2d-read").inner_text():
            break
    assert "mrad" in page.locator("#loops2d-read").inner_text()


def test_a_table_is_sorted_by_value(open_page):
    page = open_page()

    def column(index):
        return [float(v) for v in page.locator(f"#terms-table tbody tr td:nth-child({index})").evaluate_all(
            "cells => cells.map(cell => shownNumber(cell.textContent))")]  # fmt: skip

    heading = page.locator("#terms-table th", has_text="Unique share")
    heading.locator("button").click()
    assert heading.get_attribute("aria-sort") == "ascending" and column(7) == sorted(column(7))
    heading.locator("button").press("Enter")
    assert heading.get_attribute("aria-sort") == "descending" and column(7) == sorted(column(7), reverse=True)
    names = page.locator("#terms-table th", has_text="Term")
    names.locator("button").click()
    shown = page.locator("#terms-table tbody th").all_inner_texts()
    assert shown == sorted(shown, key=str.lower)
    assert heading.get_attribute("aria-sort") is None


def test_a_table_is_copied(open_page):
    page = open_page(permissions=["clipboard-read", "clipboard-write"])
    button = page.locator("#terms .tools button")
    button.click()
    page.locator("#terms .tools").get_by_text("Copied", exact=True).wait_for()
    copied = page.evaluate("navigator.clipboard.readText()").splitlines()
    assert copied[0].split("\t")[:3] == ["Term", "Symbol", "Of"]
    assert len(copied) == 6 and all(len(line.split("\t")) == 7 for line in copied)


def test_print_view(open_page, picture_of):
    page = open_page(color_scheme="dark")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    picture_of(page, "print.png", full_page=True)
    assert page.locator("button:not(th button):visible").count() == 0
    assert not page.locator(".bar").is_visible() and not page.locator("#map3d").is_visible()
    assert page.locator("#figure-map svg").is_visible() and page.locator("#path-table").is_visible()
    assert luminance(page) == 1.0 and luminance(page, "h1", "color") == 0.0
    pdf = page.pdf(format="A4")
    assert pdf.startswith(b"%PDF") and pdf.count(b"/Type /Page\n") <= 12


def test_narrow_view_does_not_scroll_sideways(open_page, picture_of):
    page = open_page(viewport={"width": 360, "height": 740})
    picture_of(page, "narrow.png", full_page=True)
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    box = page.locator(".answer").bounding_box()
    assert box["y"] + box["height"] < 740


def test_no_value_breaks_at_its_error_on_a_phone(open_page):
    page = open_page(viewport={"width": 390, "height": 844})
    lines = """cells => cells.map(cell => {
        const range = document.createRange();
        range.selectNodeContents(cell);
        return new Set([...range.getClientRects()].map(box => Math.round(box.top))).size;
    })"""
    assert set(page.locator("#terms-table td.whole").evaluate_all(lines)) == {1}
    assert "±\u00a0" in page.locator(".lights").first.inner_text()


def test_dark_view(open_page, picture_of):
    page = open_page(color_scheme="dark")
    picture_of(page, "dark.png", full_page=True)
    assert luminance(page) < 0.1 < 0.7 < luminance(page, "h1", "color")
    # The drawings follow: the axes of a figure and the floor of the map are light on dark.
    assert (
        luminance(
            page,
            "#figure-loops svg text, #figure-loops svg g[style*='ink'] use, #figure-loops svg use",
            "fill",
        )
        > 0.5
    )
    assert luminance(open_page(color_scheme="light")) > 0.9


def test_the_theme_button_turns_the_page_and_the_drawings(open_page):
    page = open_page()
    canvas = page.locator("#map3d canvas")
    canvas.scroll_into_view_if_needed()
    light = picture(canvas)
    page.locator("#theme").click()
    assert luminance(page) < 0.1 and page.locator("#theme").inner_text() == "Light"
    assert picture(canvas) != light
    page.locator("#theme").click()
    assert luminance(page) > 0.9


def test_by_keyboard_and_screen_reader(open_page):
    page = open_page()
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"
    # Everything that can be operated has a name, and headings go down in steps of one.
    nameless = page.evaluate(
        """() => {
            const all = [...document.querySelectorAll("button, select, input, canvas, svg[role=img], [role=region]")];
            const named = (e) => e.getAttribute("aria-label") || e.labels?.length || e.textContent.trim();
            return all.filter((e) => !named(e)).map((e) => e.outerHTML.slice(0, 80));
        }"""
    )
    assert nameless == []
    levels = page.evaluate("[...document.querySelectorAll('h1, h2, h3')].map(e => Number(e.tagName[1]))")
    assert levels[0] == 1 and all(
        after - before <= 1 for before, after in zip(levels, levels[1:], strict=False)
    )
    assert page.evaluate("document.documentElement.lang") == "en"


def test_without_scripts_everything_but_turning_is_there(open_page):
    page = open_page(java_script_enabled=False)
    assert page.locator("#figure-map svg").is_visible() and page.locator("#terms-table").is_visible()
    assert not page.locator("#map3d").is_visible() and not page.locator("#theme").is_visible()
