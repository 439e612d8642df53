"""What is tried of a report."""

from browser_tools import DESK, PHONE, TABLET, bare, farthest_mm, opened, texts

# Of A4, in report.css.
MARGIN_MM = 15.0
# Headings, what announces something, and rows of tables, by their text.
PARTS = """() => {
    const all = (selector) => Array.from(document.querySelectorAll(selector));
    const cells = (row) => Array.from(row.cells).map((cell) => cell.textContent).join("");
    return {
        first: [...all("h1, h2").map((e) => e.textContent), ...all("thead tr").map(cells),
            ...all("main > p").map((e) => e.textContent).filter((text) => text.trim().endsWith(":"))],
        rows: all("tr").map(cells),
        names: all("[role=region]").map((e) => e.getAttribute("aria-label")),
        loose: all("thead th:not([scope=col]), tbody th:not([scope=row])").length,
    };
}"""
# Tables that are wider than the sheet.
WIDE = """() => Array.from(document.querySelectorAll(".table")).filter((e) => e.scrollWidth > e.clientWidth)
    .map((e) => e.textContent.slice(0, 60))"""
NOWHERE = """() => Array.from(document.querySelectorAll("nav a"))
    .filter((a) => !document.querySelector(a.getAttribute("href"))).length"""
FOCUS = "() => [document.activeElement.tagName, getComputedStyle(document.activeElement).outlineStyle !== 'none']"
PRINTED_PX = round((210 - 2 * MARGIN_MM) / 25.4 * 96)


def whole(browser, path, checks):
    with opened(browser, path, PHONE, checks) as tab:
        tab.rules()
        tab.fits()
        tab.page.set_viewport_size({"width": 320, "height": 640})
        tab.fits()
        scrolled(tab)
    with opened(browser, path, TABLET, checks) as tab:
        tab.fits()
    with opened(browser, path, DESK, checks) as tab:
        tab.rules("dark")
        tab.fits()
        keys(tab)
        printed(tab)


def scrolled(tab):
    """A table wider than a phone scrolls in itself, and its last column can be reached by the keyboard."""
    table = ".table:has(thead th:nth-child(5))"
    if not tab.page.locator(table).count():
        return
    tab.page.locator(table).first.focus()
    for _ in range(40):
        tab.page.keyboard.press("ArrowRight")
    tab.page.wait_for_timeout(300)
    script = f"() => {{ const e = document.querySelector('{table}'); return e.scrollWidth - e.clientWidth - e.scrollLeft; }}"
    tab.say(tab.page.evaluate(script) < 2, "a wide table doesn't scroll by the keyboard")


def keys(tab):
    """Links lead to sections; every stop is seen."""
    tab.page.keyboard.press("Tab")
    tab.same("the first stop of the keyboard, and that it is seen", tab.page.evaluate(FOCUS), ["A", True])
    tab.same("links to nowhere", tab.page.evaluate(NOWHERE), 0)
    tab.page.keyboard.press("Enter")
    tab.say(tab.page.evaluate("location.hash") == "#s0", "a link isn't followed by the keyboard")


def printed(tab):
    parts = tab.page.evaluate(PARTS)
    tab.say(len(parts["rows"]) > 5, "found hardly a row of a table")
    tab.same("cells of heads without a scope", parts["loose"], 0)
    tab.same("tables of the same name", len(parts["names"]) - len(set(parts["names"])), 0)
    tab.page.set_viewport_size({"width": PRINTED_PX, "height": 1000})
    tab.page.emulate_media(media="print")
    tab.same("tables wider than the sheet", tab.page.evaluate(WIDE), [])
    tab.page.emulate_media(media="null")
    sheets = tab.sheets()
    pages = texts(sheets)
    letters = [bare(text) for text in pages]
    cut = [row for row in parts["rows"] if not any(bare(row) in page for page in letters)]
    tab.say(not cut, f"rows that aren't whole on a sheet: {cut}")
    for number, (sheet, text) in enumerate(zip(sheets, pages), 1):
        tab.say(farthest_mm(sheet) > MARGIN_MM - 0.5, f"sheet {number}: letters {farthest_mm(sheet):.1f} mm from the right edge")
        last = bare(text.strip().splitlines()[-1]) if text.strip() else ""
        alone = [one for one in parts["first"] if bare(one) == last]
        tab.say(number == len(pages) or not alone, f"sheet {number} ends with {alone}")
