"""Checks of the built site in a browser: narrow screens, printing, and search from a disk.

    python docs/hooks/check_site.py build/site

The site is opened from file://, as a reader without a network or a server opens it. Without
playwright or a browser, the checks are skipped with a line that says so.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Any

PHONE_WIDTH = 390  # px, of common telephones

QUERY = "tether"  # a word that many pages have

WIDER = """() => {
  const limit = document.documentElement.clientWidth + 1;
  const scrolls = (e) => e && (/auto|scroll|hidden/.test(getComputedStyle(e).overflowX)
    || scrolls(e.parentElement));
  if (document.documentElement.scrollWidth <= limit) return null;
  const wide = [...document.querySelectorAll(".md-content *")].filter(
    (e) => e.getBoundingClientRect().right > limit && !scrolls(e.parentElement));
  return wide.slice(0, 3).map((e) => e.tagName + " " + e.textContent.trim().slice(0, 60));
}"""
"""Script: null if the page does not scroll sideways, or else what is too wide."""

VISIBLE = """() => [".md-header", ".md-sidebar", ".md-footer", ".md-top"].filter((name) =>
  [...document.querySelectorAll(name)].some((e) => e.offsetParent && e.offsetHeight))"""
"""Script: the parts of the navigation that are visible."""

CUT = """() => [...document.querySelectorAll("pre > code")].filter(
  (e) => e.scrollWidth > e.clientWidth + 1).map((e) => e.textContent.trim().slice(0, 60))"""
"""Script: code that is cut at the edge of the paper."""


def narrow(browser: Any, file: Path) -> list[str]:
    """Return what makes a page scroll sideways on a narrow screen."""
    page = browser.new_page(viewport={"width": PHONE_WIDTH, "height": 844})
    page.goto(file.as_uri())
    wide = page.evaluate(WIDER)
    page.close()
    return [] if wide is None else [f"scrolls sideways at {PHONE_WIDTH} px: {wide}"]


def printed(browser: Any, file: Path) -> list[str]:
    """Return what is wrong with a page on paper."""
    page = browser.new_page(viewport={"width": 718, "height": 1000})
    page.goto(file.as_uri())
    page.emulate_media(media="print")
    found = [f"printed with its {part}" for part in page.evaluate(VISIBLE)]
    found += [f"code is cut on paper: {code}" for code in page.evaluate(CUT)]
    page.close()
    return found


def searched(browser: Any, site: Path) -> list[str]:
    """Return what is wrong with the search."""
    page = browser.new_page()
    page.goto((site / "index.html").as_uri())
    page.locator(".md-search__input").press_sequentially(QUERY)  # it listens to keys
    try:
        page.wait_for_selector(".md-search-result__link", timeout=20_000)
    except Exception as error:
        return [f"search for {QUERY!r} finds nothing: {str(error).splitlines()[0]}"]
    finally:
        page.close()
    return []


def main(site: Path) -> int:
    """Print what the checks find, and return 1 if that is anything."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        print("check_site: playwright is not installed (extra test): nothing is checked")
        return 0
    found = []
    if not (site / "index.html").exists():
        print(f"check_site: no site in {site}")
        return 1
    with sync_playwright() as play:
        chromium = shutil.which("chromium") or shutil.which("chromium-browser")
        try:
            browser = play.chromium.launch(executable_path=chromium)
        except Exception as error:
            print(f"check_site: no browser, nothing is checked: {str(error).splitlines()[0]}")
            return 0
        for file in sorted(
            set(site.rglob("*.html")) - {site / "404.html"}
        ):  # its links are absolute
            name = file.relative_to(site)
            for check in (narrow, printed):
                found += [f"{name}: {what}" for what in check(browser, file)]
        found += [f"search: {what}" for what in searched(browser, site.resolve())]
        browser.close()
    for what in found:
        print(what)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]).resolve()))
