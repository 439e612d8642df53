"""The patient's page and the report in Chromium without a network: what a person sees, touches, reads and prints.

Usage: browser.py PROGRAM CHROMIUM [--data FOLDER] [--keep FOLDER]. CHROMIUM: its path, or "playwright" for Playwright's own.
FOLDER of data: real cases beside the sample. Everything is made in a temporary folder, or in that of --keep, with pictures.
browser.py --starts CHROMIUM: whether it starts and draws.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import browser_page as page
import browser_report as report
from browser_tools import ARGUMENTS, DESK, PHONE, SIZES, TWO_FRAMES, Checks, opened
from playwright.sync_api import Error, sync_playwright

# Faults of every kind, that must be found: else a check can't fail.
FAULTY = """<!DOCTYPE html><html lang="en"><head><title>Faults</title><meta name="viewport" content="width=device-width">
<style>@page { size: A5 } @media print { td { min-width: 300mm } }</style></head><body><main><h1>Faults</h1>
<img src="http://192.0.2.1/x.png" alt="x">
<div class="table" tabindex="0"><table><thead><tr><th>head</th></tr></thead><tbody><tr><td>cell</td></tr></tbody></table></div>
<p style="color:#bbb;background:#fff">pale</p><div style="width:900px">wide</div><button style="width:9px;height:9px"></button>
<script>console.error("said"); setTimeout(() => { throw new Error("thrown"); });</script></main></body></html>"""
FOUND = ["192.0.2.1", "color-contrast", "sideways", "smaller than", "said", "thrown", "still", "hardly a row", "without a scope",
    "wider than the sheet", "the bar", "the sheet has"]


def faults_are_found(browser, folder, checks):
    path = folder / "faulty.html"
    path.write_text(FAULTY)
    own = Checks()
    with opened(browser, path, PHONE, own) as tab:
        tab.rules()
        tab.fits()
        tab.targets()
        tab.changes("h1", tab.pixels("h1"), "still")
        page.printed(tab)
        report.printed(tab)
    for fault in FOUND:
        checks.say(any(fault in one for one in own.faults), f"a fault isn't found: {fault}, only {own.faults}")


def made(program, folder, name, *arguments):
    path = folder / f"{name}.html"
    run = subprocess.run([program, *map(str, arguments), "--out", path], capture_output=True, text=True)
    if run.returncode != 0:
        raise RuntimeError(f"{arguments}: {run.stderr}")
    return path


def jobs(data):
    """Name, arguments, and what is tried, in the order of making."""
    glioma, pair = (data / name for name in ("glioma-5-algorithms", "reported/14-cat12-62-prepost")) if data else (None, None)
    german = ["--language", "de"]
    is_real = [case for case in (glioma, pair) if case and case.is_dir()]
    yield "page-sample", ["page", "--sample"], page.whole
    if glioma in is_real:
        yield "page-glioma", ["page", glioma], lambda *given: page.whole(*given, case=glioma)
    yield "page-german", ["page", "--sample", *german], page.brief
    if pair in is_real:
        yield "page-pair", ["page", pair, "--order", "pre,post"], page.brief
    yield "report-sample", ["report", "--sample", "--criteria", "rano-2.0"], report.whole
    yield "report-german", ["report", "--sample", *german], report.whole
    if glioma in is_real:
        yield "report-glioma", ["report", glioma, *german], report.whole
    if pair in is_real:
        yield "report-pair", ["report", pair, "--order", "pre,post"], report.whole


def chromium(play, path):
    return play.chromium.launch(executable_path=None if path == "playwright" else path, args=ARGUMENTS)


def starts(path):
    try:
        with sync_playwright() as play:
            tab = chromium(play, path).new_page()
            return tab.evaluate("Boolean(document.createElement('canvas').getContext('webgl2'))")
    except Error as why:
        print(why, file=sys.stderr)
        return False


def keep(browser, path, folder):
    for size, given in SIZES.items():
        for colours in ("light", "dark"):
            # Not as a phone: Chromium repeats the first screens of long pages then.
            whole = browser.new_page(viewport=given["viewport"], color_scheme=colours)
            whole.goto(path.as_uri())
            whole.evaluate(TWO_FRAMES)
            whole.screenshot(path=folder / f"{path.stem}-{size}-{colours}.png", full_page=True)
            if (size, colours) == (DESK, "light"):
                whole.pdf(path=folder / f"{path.stem}.pdf", prefer_css_page_size=True, print_background=True)
            whole.close()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program", nargs="?")
    parser.add_argument("chromium", nargs="?")
    parser.add_argument("--data", type=Path)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--starts")
    given = parser.parse_args()
    if given.starts:
        sys.exit(not starts(given.starts))
    started, checks = time.monotonic(), Checks()
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(1) as maker, sync_playwright() as play:
        folder = given.keep or Path(scratch)
        folder.mkdir(exist_ok=True)
        make = lambda name, arguments: maker.submit(made, given.program, folder, name, *arguments)
        work = [(make(name, arguments), trial) for name, arguments, trial in jobs(given.data)]
        browser = chromium(play, given.chromium)
        faults_are_found(browser, folder, checks)
        for path, trial in work:
            path, began = path.result(), time.monotonic()
            trial(browser, path, checks)
            if given.keep:
                keep(browser, path, folder)
            print(f"{path.stem}: {path.stat().st_size / 1e6:.1f} MB, {time.monotonic() - began:.1f} s", file=sys.stderr)
        browser.close()
    for fault in checks.faults:
        print(fault, file=sys.stderr)
    what = f"{checks.count} checks in Chromium, {len(checks.faults)} failed, {time.monotonic() - started:.0f} s"
    if checks.faults:
        sys.exit(what)
    print(what)


main()
