"""A browser without a network, and what is measured in it: faults of a page, pixels, rules of accessibility, printed sheets."""

import base64
import io
import re
import time
from contextlib import contextmanager

import numpy as np
import pypdfium2
from axe_playwright_python.sync_playwright import Axe
from PIL import Image

# Widths of a phone, a tablet and a desk, CSS pixels.
PHONE, TABLET, DESK = "phone", "tablet", "desk"
SIZES = {
    PHONE: {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True},
    TABLET: {"viewport": {"width": 820, "height": 1180}, "has_touch": True, "is_mobile": True},
    DESK: {"viewport": {"width": 1440, "height": 900}},
}
# WebGL is drawn on the processor: the same pixels on any machine. Putting layers together without it is several times faster.
ARGUMENTS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-gpu-compositing"]
# A finger's width (WCAG 2.2, 2.5.5), and the least on the narrowest phones (2.5.8), CSS pixels.
FINGER, LEAST = 44, 24
# Pixels that hiding a part changes at least, and how long a change may take.
FEW, PATIENCE_S = 40, 3.0
# Two pixels differ where a channel does by more.
CHANNEL = 12
MM_PER_POINT = 25.4 / 72
AXE = Axe()
AXE_OPTIONS = {"resultTypes": ["violations"], "rules": {"target-size": {"enabled": True}}}
TWO_FRAMES = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
# Shows an element; its left, upper, right and lower edge on the screen.
IN_VIEW = """(selector) => {
    document.activeElement.blur();
    scrollTo(0, 0);
    const element = document.querySelector(selector);
    if (element.getBoundingClientRect().bottom > innerHeight) element.scrollIntoView({ block: "start" });
    const box = element.getBoundingClientRect();
    return [box.left, box.top, box.right, box.bottom];
}"""


class Checks:
    """What was checked, and what was found wrong."""

    def __init__(self):
        self.count, self.faults = 0, []

    def say(self, is_right, what):
        self.count += 1
        if not is_right:
            self.faults.append(what)

    def same(self, what, found, expected):
        self.say(found == expected, f"{what}: found {found}, expected {expected}")


class Tab:
    """A page of one file, at one size."""

    def __init__(self, page, name, checks):
        self.page, self.name, self.checks = page, name, checks
        self.devtools = page.context.new_cdp_session(page)

    def say(self, is_right, what):
        self.checks.say(is_right, f"{self.name}: {what}")

    def same(self, what, found, expected):
        self.checks.same(f"{self.name}: {what}", found, expected)

    def settle(self):
        self.page.evaluate(TWO_FRAMES)

    def pixels(self, selector):
        """What the screen shows of an element, always at the same place of it: lines fall on pixels alike."""
        box = self.page.evaluate(IN_VIEW, selector)
        self.settle()
        # Several times faster than Playwright's screenshots.
        picture = self.devtools.send("Page.captureScreenshot", {"format": "png", "optimizeForSpeed": True})["data"]
        screen = np.asarray(Image.open(io.BytesIO(base64.b64decode(picture))).convert("RGB")).astype(int)
        left, top, right, bottom = (max(0, round(edge)) for edge in box)
        return screen[top:bottom, left:right]

    def until(self, selector, is_right):
        """What an element shows, once it is right: a busy machine draws late. At the latest after `PATIENCE_S`."""
        latest = time.monotonic() + PATIENCE_S
        while True:
            picture = self.pixels(selector)
            if is_right(picture) or time.monotonic() > latest:
                return picture

    def still(self, selector):
        """What an element shows when nothing changes any more, as after another colour scheme."""
        pictures = [self.pixels(selector)]

        def is_still(picture):
            pictures.append(picture)
            return changed(*pictures[-2:]) == 0

        return self.until(selector, is_still)

    def changes(self, selector, old, what, least=FEW):
        """At least so many pixels of an element change; what it shows then."""
        new = self.until(selector, lambda new: changed(old, new) >= least)
        self.say(changed(old, new) >= least, f"{what}: {changed(old, new)} pixels change of {selector}, expected {least}")
        return new

    def returns(self, selector, old, what, most=0):
        """An element shows what it showed before, but for so many pixels."""
        new = self.until(selector, lambda new: changed(old, new) <= most)
        self.say(changed(old, new) <= most, f"{what}: {changed(old, new)} pixels of {selector} aren't as before")

    def rules(self, colours="light"):
        """Accessibility by axe-core, all its rules, in a colour scheme."""
        self.page.emulate_media(color_scheme=colours)
        for fault in AXE.run(self.page, options=AXE_OPTIONS).response["violations"]:
            first, times = fault["nodes"][0], len(fault["nodes"])
            self.say(False, f"{colours}: axe {fault['id']}, {times} times, {first['target']}: {first['failureSummary']}")
        self.say(True, "axe")
        self.page.emulate_media(color_scheme="light")

    def fits(self):
        """Nothing makes the page wider than the screen."""
        beyond = self.page.evaluate("document.scrollingElement.scrollWidth - document.scrollingElement.clientWidth")
        self.same("scrolls sideways by pixels", beyond, 0)

    def targets(self, least=FINGER):
        """What is tapped is as large as a finger."""
        script = """() => Array.from(document.querySelectorAll('button, input, .part .hit')).map((e) => {
            const b = e.getBoundingClientRect();
            return [e.id || e.textContent.trim() || e.parentNode.textContent, Math.min(b.width, b.height)];
        }).filter((b) => b[1] > 0)"""
        targets = self.page.evaluate(script)
        self.say(len(targets) > 0, "found nothing to tap")
        small = [target for target in targets if target[1] < least - 0.5]
        self.say(not small, f"targets smaller than {least} px: {small}")

    def touch(self, *fingers, steps=6):
        """Fingers that go from one place to another, as the screen reports them."""
        for step in range(steps + 1):
            at = [
                {"x": a[0] + (b[0] - a[0]) * step / steps, "y": a[1] + (b[1] - a[1]) * step / steps, "id": n}
                for n, (a, b) in enumerate(fingers)
            ]
            kind = "touchMove" if step else "touchStart"
            self.devtools.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": at})
        self.devtools.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})

    def press(self, selector):
        """A tap or a click in the middle of an element, on whatever lies there."""
        element = self.page.locator(selector).first
        element.scroll_into_view_if_needed()
        box = element.bounding_box()
        device = self.page.mouse.click if self.name.endswith(DESK) else self.page.touchscreen.tap
        device(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        self.settle()

    def sheets(self):
        """The printed sheets."""
        return pypdfium2.PdfDocument(self.page.pdf(prefer_css_page_size=True, print_background=True))


@contextmanager
def opened(browser, path, size, checks):
    """`path` at a size, nothing but it being loaded. What it asks for and says in the console is a fault."""
    context = browser.new_context(**SIZES[size], offline=True, locale="en")
    page = context.new_page()
    tab = Tab(page, f"{path.name}, {size}", checks)
    own = path.as_uri()

    def asked(url):
        if not url.startswith("data:"):
            tab.say(url.split("#")[0] == own, f"asks for {url}")

    context.route("**/*", lambda route: route.continue_() if route.request.url.split("#")[0] == own else route.abort())
    page.on("request", lambda request: asked(request.url))
    page.on("websocket", lambda socket: asked(socket.url))
    page.on("console", lambda line: tab.say(line.type != "error", f"the console: {line.text}"))
    page.on("pageerror", lambda error: tab.say(False, f"a script: {error}"))
    page.goto(own)
    # The mark that a tap leaves fades in its own time.
    page.evaluate("document.documentElement.style.setProperty('-webkit-tap-highlight-color', 'transparent')")
    tab.settle()
    yield tab
    context.close()


def changed(a, b):
    """The number of pixels that differ."""
    return int((np.abs(a - b).max(axis=2) > CHANNEL).sum()) if a.shape == b.shape else a.shape[0] * a.shape[1]


def raster(sheet, pixels_per_mm):
    """A sheet as RGB."""
    return np.asarray(sheet.render(scale=pixels_per_mm * MM_PER_POINT).to_pil().convert("RGB")).astype(int)


def longest_run(is_dark):
    """Row, first column and length of the longest run of dark pixels in a row."""
    best = (0, 0, 0)
    for row, line in enumerate(is_dark):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], line.astype(np.int8), [0]])))
        starts, ends = edges[::2], edges[1::2]
        if len(starts):
            n = int(np.argmax(ends - starts))
            best = max(best, (row, int(starts[n]), int(ends[n] - starts[n])), key=lambda run: run[2])
    return best


def bare(text):
    """Letters alone: spaces and hyphens depend on where lines end."""
    return re.sub(r"[\s\u00ad\ufffe\x02-]", "", text)


def texts(document):
    """The text of each sheet, line by line."""
    return [sheet.get_textpage().get_text_range() for sheet in document]


def farthest_mm(sheet):
    """How near to the right edge of a sheet its letters come."""
    text = sheet.get_textpage()
    boxes = [text.get_charbox(n) for n in range(text.count_chars())]
    # Ends of lines have no width.
    rights = [right for left, _, right, _ in boxes if right > left]
    return (sheet.get_width() - max(rights, default=0)) * MM_PER_POINT
