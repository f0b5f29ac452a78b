"""Look at every page of the built site in a browser.

    mkdocs build --strict && python docs/check_site.py [--pictures FOLDER]

Exits 1 where a page is wider than a screen of 390, 820 or 1440 pixels, or, other than a reference,
longer than five screens of 1440 x 900. Leaves in the folder a picture of each page at each width,
light and dark. Without a chromium on the path nothing is looked at.
"""

import argparse
import shutil
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

SITE = Path(__file__).parents[1] / "site"
WIDTHS = (390, 820, 1440)
"""A phone, a tablet and a desktop [px]."""
SCREEN = 900
"""Height of a desktop's window [px]."""
MOST_SCREENS = 5


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Print nothing."""


@contextmanager
def served(site: Path) -> Iterator[str]:
    """Serve a folder and yield its address."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Quiet, directory=str(site)))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        thread.join()


def fault(tab: Page, width: int) -> str:
    """Return what is wrong with the size of a page, or an empty text."""
    wide, high, part = tab.evaluate(
        """[document.documentElement.scrollWidth, document.querySelector("article").offsetHeight,
        document.querySelector(".md-tabs__item--active")?.textContent.trim()]"""
    )
    if wide > width:
        return f"{wide} px wide on a screen of {width} px"
    if width == max(WIDTHS) and part != "Reference" and high > MOST_SCREENS * SCREEN:
        return f"{high / SCREEN:.1f} screens long, at most {MOST_SCREENS} wanted"
    return ""


def main() -> int:
    """Print what is wrong, and return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--pictures", type=Path, metavar="FOLDER")
    pictures: Path | None = parser.parse_args().pictures
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        print("no chromium on the path: the site was not looked at")
        return 0
    if not SITE.is_dir():
        print(f"no site; got {SITE}; wanted the output of `mkdocs build`", file=sys.stderr)
        return 2
    found = 0
    with served(SITE) as address, sync_playwright() as play:
        chromium = play.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        tab = chromium.new_page()
        for file in sorted(SITE.rglob("index.html")):
            name = file.parent.relative_to(SITE).as_posix()
            tab.goto(f"{address}/{name}/")
            for width in WIDTHS:
                tab.set_viewport_size({"width": width, "height": SCREEN})
                if wrong := fault(tab, width):
                    print(f"{name}: {wrong}", flush=True)
                    found += 1
                for scheme in ("light", "dark") if pictures else ():
                    tab.emulate_media(color_scheme=scheme)
                    shot = f"{name.replace('/', '.')}-{width}-{scheme}.png"
                    tab.screenshot(path=Path(str(pictures)) / shot)
        chromium.close()
    return min(found, 1)


if __name__ == "__main__":
    sys.exit(main())
