"""The live page in a real browser, for tests."""

import os
import shutil
from contextlib import contextmanager

import pytest
from operators import PATIENCE, wait_for

WIDTH, HEIGHT = 700, 400
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
DRAWS_IN_SOFTWARE = (
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip
DRAWS_NOTHING = ("--disable-gpu", "--disable-3d-apis")

LATE = float(os.environ.get("POISE_PAGE_LATE", "0"))
"""By how much pages are late [s], to find tests that do not wait for them."""

COMES_LATE = """
  const late = 1000 * %s, frame = window.requestAnimationFrame;
  window.requestAnimationFrame = (draw) => setTimeout(() => frame(draw), late);
  for (const name of ["onmessage", "onclose"]) {
    const real = Object.getOwnPropertyDescriptor(WebSocket.prototype, name);
    Object.defineProperty(WebSocket.prototype, name, {
      configurable: true,
      get() { return real.get.call(this); },
      set(take) { real.set.call(this, take && ((event) => setTimeout(() => take(event), late))); },
    });
  }
"""
"""A page that draws late, and hears late of messages and of the end of its connection."""


@contextmanager
def playwright():
    """What starts browsers, of which a thread has one at a time; skips where there is none."""
    api = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed, it comes with the extra dev"
    )
    if CHROMIUM is None:
        pytest.skip("no chromium on this machine")
    with api.sync_playwright() as play:
        yield play


@contextmanager
def chromium(play, *options):
    """A browser."""
    browser = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", *options])
    yield browser
    browser.close()


class Page:
    """A page, spoken to by scripts: a browser that draws in software is slow to anything else."""

    def __init__(self, browser, url, **device):
        self.errors = []
        self.page = browser.new_page(**{"viewport": {"width": WIDTH, "height": HEIGHT}} | device)
        self.page.set_default_timeout(1e3 * PATIENCE)
        # A busy machine takes minutes to start what a browser needs for its first page.
        self.page.set_default_navigation_timeout(4e3 * PATIENCE)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        if LATE > 0.0:
            self.page.add_init_script(COMES_LATE % LATE)
        self.page.goto(url)
        # What is shown comes a frame or more after the message that says it.
        self.wait("part('mode-text').textContent.trim() !== ''", "the first status to be shown")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.page.close()

    def ask(self, script):
        return self.page.evaluate(script)

    def text(self, name):
        return self.ask(f"part('{name}').textContent")

    def wait(self, script, what):
        return wait_for(lambda: self.ask(script), what)
