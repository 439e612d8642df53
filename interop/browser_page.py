"""What is tried of the page that a patient takes home."""

import base64
import io

import nibabel
import numpy as np
from PIL import Image

from browser_tools import DESK, LEAST, MM_PER_POINT, PHONE, TABLET, changed, longest_run, opened, raster

MOST_BYTES = 8_000_000
A4_MM = (210.0, 297.0)
# Of the bar that a reader measures.
BAR_MM = 50.0
PIXELS_PER_MM = 10
# Lines are so wide, half of that beyond the mask at each side.
LINE_MM = 0.6
# Found: 0.1 mm. A sheet shrunk by a hundredth is off by 0.6 mm.
OUTLINES_MM = 0.5
CANVAS, SLICES, DIAGRAMS = "#canvas", "section.date:not([hidden]) .pictures", "section.date:not([hidden]) .diagrams"
# Pixels that turning or zooming the model changes at least.
MANY = 1500
STOPS = """() => Array.from(document.querySelectorAll("a[href], button, input, [tabindex='0']"))
    .filter((e) => e.getClientRects().length > 0)"""
# The place of what has the focus among the stops, and whether it is seen to have it.
FOCUS = f"""() => {{
    const e = document.activeElement, style = getComputedStyle(e), hit = e.querySelector(".hit");
    const isLine = style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 2;
    return [({STOPS})().indexOf(e), isLine || (hit !== null && getComputedStyle(hit).stroke !== "none")];
}}"""
SHOWN = """([kind, n]) => Array.from(document.querySelectorAll(`section.date:not([hidden]) [data-${kind}-path="${n}"]`))
    .filter((path) => getComputedStyle(path).display !== "none").length"""


def whole(browser, path, checks, case=None):
    checks.say(path.stat().st_size < MOST_BYTES, f"{path.name}: {path.stat().st_size} bytes")
    for size in (PHONE, TABLET, DESK):
        with opened(browser, path, size, checks) as tab:
            tab.rules()
            tab.rules("dark")
            tab.fits()
            turns(tab, size)
            if size == PHONE:
                air(tab)
                hides(tab, (CANVAS, SLICES, DIAGRAMS))
                plays(tab)
                fingers(tab)
            if size == DESK:
                hides(tab, (CANVAS,))
                keys(tab)
                printed(tab, case)


def brief(browser, path, checks):
    with opened(browser, path, PHONE, checks) as tab:
        tab.rules()
        tab.fits()
        tab.targets()
        plays(tab)
        printed(tab)


def air(tab):
    """Near its edge a slice is air, and that is black."""
    picture = tab.page.locator("section.date:not([hidden]) image").first.get_attribute("href")
    gray = np.asarray(Image.open(io.BytesIO(base64.b64decode(picture.split(",")[1]))))
    # Within the image: what is beyond is black anyway.
    edge = np.concatenate([gray[8], gray[-8], gray[:, 8], gray[:, -8]])
    tab.say(np.median(edge) <= 8, f"air in a slice has a gray of {np.median(edge)} of 255")


def turns(tab, size):
    """One finger, or the mouse, turns the model and leaves the page where it is; Reset brings it back."""
    is_drawn = lambda picture: len(np.unique(picture.reshape(-1, 3), axis=0)) > 50
    before = tab.still(CANVAS)
    tab.say(is_drawn(before), "the model isn't drawn")
    box = tab.page.locator(CANVAS).bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    if size == DESK:
        tab.page.mouse.move(x, y)
        tab.page.mouse.down()
        tab.page.mouse.move(x + 90, y - 50, steps=4)
        tab.page.mouse.up()
    else:
        tab.touch(((x, y), (x + 90, y - 50)))
    tab.settle()
    tab.same("the page moved while the model turned, px", tab.page.evaluate("scrollY"), 0)
    tab.changes(CANVAS, before, "turned", MANY)
    tab.press("#reset")
    tab.returns(CANVAS, before, "Reset")


def fingers(tab):
    """Two fingers zoom the model, not the page; beside the model one finger moves the page. It fits a narrow phone, too."""
    tab.targets()
    tab.page.evaluate("scrollTo(0, 0)")
    before = tab.still(CANVAS)
    box = tab.page.locator(CANVAS).bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    tab.touch(((x - 20, y), (x - 90, y)), ((x + 20, y), (x + 90, y)))
    tab.changes(CANVAS, before, "two fingers", MANY)
    tab.same("the zoom of the page", tab.page.evaluate("visualViewport.scale"), 1)
    tab.press("#reset")
    tab.page.evaluate("document.querySelector('.pictures').scrollIntoView()")
    at = tab.page.evaluate("scrollY")
    tab.touch(((195, 600), (195, 300)))
    tab.page.wait_for_timeout(200)
    tab.say(tab.page.evaluate("scrollY") > at + 100, "a finger on the pictures doesn't move the page")
    tab.page.set_viewport_size({"width": 320, "height": 640})
    tab.fits()
    tab.targets(LEAST)
    tab.page.set_viewport_size({"width": 390, "height": 844})


def hides(tab, seen):
    """A part is hidden, and shown again, by its entry in the list and by its row in the diagram. `seen`: what changes."""
    entries = tab.page.locator(".mask:not([hidden]):not(#head)")
    tab.say(entries.count() > 0, "there are no entries")
    # The last: what all hold lies within all others.
    entry = entries.nth(entries.count() - 1)
    kind = "mask" if entry.get_attribute("data-mask") is not None else "level"
    n = entry.get_attribute(f"data-{kind}")
    row = f"section.date:not([hidden]) .part[data-{kind}='{n}']"
    ways = [f".mask:not([hidden])[data-{kind}='{n}']", f"{row} .hit"]
    before = [tab.still(one) for one in seen]
    for way in ways[: 1 + tab.page.locator(row).count()]:
        tab.say(tab.page.evaluate(SHOWN, [kind, n]) > 0, f"{way}: no outline is shown")
        tab.press(way)
        tab.same(f"{way}: outlines that are shown while hidden", tab.page.evaluate(SHOWN, [kind, n]), 0)
        tab.same(f"{way}: pressed", entry.get_attribute("aria-pressed"), "false")
        hidden = [tab.changes(one, old, f"{way}, hidden") for one, old in zip(seen, before)]
        tab.press(way)
        for one, old, new in zip(seen, before, hidden):
            tab.returns(one, old, f"{way}, shown again", changed(old, new) // 10)


def plays(tab):
    """The dates follow each other, until Stop."""
    if not tab.page.locator("#play").count():
        return
    say = lambda: tab.page.locator("#when").text_content()
    first, word = say(), tab.page.locator("#play .text").text_content()
    before = tab.still(CANVAS)
    tab.press("#play")
    tab.say(say() != first and tab.page.locator("#play .text").text_content() != word, "Play does nothing")
    tab.changes(CANVAS, before, "the other date")
    tab.page.wait_for_function("first => document.getElementById('when').textContent === first", arg=first, timeout=5000)
    tab.press("#play")
    tab.same("the button after Stop", tab.page.locator("#play .text").text_content(), word)
    tab.returns(CANVAS, before, "the date again")


def keys(tab):
    """Everything can be reached and used by the keyboard, in the order of the page, and is seen to have the focus."""
    count = tab.page.evaluate(f"({STOPS})().length")
    tab.page.evaluate("document.activeElement.blur(); scrollTo(0, 0); getSelection().removeAllRanges()")
    tab.page.mouse.click(2, 2)
    stops = []
    for _ in range(count):
        tab.page.keyboard.press("Tab")
        stops.append(tab.page.evaluate(FOCUS))
    tab.same("the stops of the keyboard", [place for place, _ in stops], list(range(count)))
    tab.same("stops that aren't seen", [place for place, is_seen in stops if not is_seen], [])
    before = old = tab.still(CANVAS)
    for key in ("ArrowLeft", "ArrowUp", "+"):
        tab.page.locator(CANVAS).press(key)
        old = tab.changes(CANVAS, old, key)
    tab.page.locator(CANVAS).press("Home")
    tab.returns(CANVAS, before, "Home")
    entry, row = ".mask:not([hidden])", "section.date:not([hidden]) .part"
    for key, selector in (("Enter", entry), ("Space", entry), ("Enter", row), ("Space", row)):
        part = tab.page.locator(selector).first
        was = part.get_attribute("aria-pressed")
        part.press(key)
        tab.say(part.get_attribute("aria-pressed") != was, f"{key} on {selector} does nothing")
    width = lambda: tab.page.locator("#true-outlines").get_attribute("width")
    was = width()
    tab.page.locator("#fit-scale").press("ArrowRight")
    tab.say(width() != was, "the size can't be set by the keyboard")


def printed(tab, case=None):
    """One sheet of A4, the bar and the largest slice in their true size."""
    sheets = tab.sheets()
    tab.same("sheets", len(sheets), 1)
    size = [length * MM_PER_POINT for length in sheets[0].get_size()]
    tab.say(np.allclose(size, A4_MM, atol=0.5), f"the sheet has {size} mm")
    picture = raster(sheets[0], PIXELS_PER_MM)
    _, left, length = longest_run(picture.max(axis=2) < 60)
    tab.say(abs(length / PIXELS_PER_MM - BAR_MM) <= 0.3, f"the bar of {BAR_MM} mm has {length / PIXELS_PER_MM} mm")
    # Colours at the left of the bar are the outlines.
    colours = (picture.max(axis=2) - picture.min(axis=2) > 60)[:, : max(0, left - 2 * PIXELS_PER_MM)]
    tab.say(colours.any(), "there are no outlines on the sheet")
    if case is None or not colours.any():
        return
    found = [float(np.ptp(places) + 1) / PIXELS_PER_MM for places in np.nonzero(colours)]
    expected = [length + LINE_MM for length in largest_mm(case)]
    tab.say(np.allclose(found, expected, atol=OUTLINES_MM), f"the outlines have {found} mm on the sheet, expected {expected} mm")


def largest_mm(case):
    """Height and width of the slice in which what any mask holds is largest; of masks along the patient's axes, voxels of 1 mm."""
    images = [nibabel.load(path) for path in sorted(case.glob("*.nii.gz"))]
    masks = [np.asarray(image.dataobj) > 0 for image in images if image.get_data_dtype() == np.uint8]
    union = np.any(masks, axis=0)
    slice_ = union[:, :, np.argmax(union.sum(axis=(0, 1)))]
    across, along = (np.ptp(places) + 1.0 for places in np.nonzero(slice_))
    return [float(along), float(across)]
