"""The studio in a real browser, for its test and its benchmark."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import Page, sync_playwright

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

SOFTWARE = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox")
"""WebGL without a graphics card; no sandbox, for root."""


NOTHING_DRAWN = """
const later = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = draw => setTimeout(() => later(draw), 100);
window.cancelAnimationFrame = clearTimeout;
const draws = ["clear", "drawArrays", "drawElements", "drawArraysInstanced", "drawElementsInstanced"];
for (const draw of [...draws, "blitFramebuffer"]) WebGL2RenderingContext.prototype[draw] = () => {};
"""
"""Runs in a page first: ten times a second it does all that a picture takes, but for the pixels."""


@contextmanager
def open_pages(
    address: str, count: int = 1, size: tuple[int, int] = (1440, 900), sparing: bool = False
) -> Iterator[list[Page]]:
    """The studio in some windows of one browser, once all of it is there.

    Args:
        address: Where it is.
        count: How many windows.
        size: Of each [pixels].
        sparing: Its pictures stay empty: without a graphics card these take nearly all of the time.
    """
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(SOFTWARE))
        try:
            pages = []
            for _ in range(count):
                page = browser.new_page(
                    viewport={"width": size[0], "height": size[1]},
                    device_scale_factor=0.25 if sparing else 1.0,
                    reduced_motion="reduce" if sparing else "no-preference",
                )
                page.set_default_timeout(60_000)
                if sparing:
                    page.add_init_script(NOTHING_DRAWN)
                page.goto(address)
                page.wait_for_selector(".studio-facts")
                page.wait_for_selector(".studio-pad")
                pages.append(page)
            yield pages
        finally:
            browser.close()


def element(page: Page, label: str, kind: str = "input"):
    """The input beside a label."""
    row = page.get_by_text(label, exact=True).locator(f"xpath=ancestor::div[.//{kind}][1]")
    return row.first.locator(f"{kind}:visible").first
