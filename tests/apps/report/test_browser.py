"""The page in a real browser: no errors, a replay that draws, controls that move the time."""

import json
import shutil
import subprocess
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest
from synthetic_run import walking_record

from poise.apps.report import Check, write_report

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")

# The probe runs inside the page and sends what it saw to the test, which listens.
COLLECT_ERRORS = """<script>
window.seen = { errors: [] };
window.addEventListener("error", (e) => window.seen.errors.push(String(e.message)));
const complain = console.error;
console.error = (...all) => { window.seen.errors.push(all.join(" ")); complain(...all); };
</script>"""
NO_WEBGL = "<script>HTMLCanvasElement.prototype.getContext = () => null;</script>"
PROBE = """<script>
const part = (name) => document.querySelector(`[data-part="${name}"]`);
// A picture waits for the one before it to be done, which takes software a while.
const twice = (done) => requestAnimationFrame(() => requestAnimationFrame(done));
const frame = () => new Promise((done) => setTimeout(() => twice(done), 100));
function picture() {
  const small = document.createElement("canvas");
  small.width = 96; small.height = 48;
  const pen = CanvasRenderingContext2D.prototype.drawImage && small.getContext("2d");
  if (!pen) return [];
  pen.drawImage(part("canvas"), 0, 0, 96, 48);
  return Array.from(pen.getImageData(0, 0, 96, 48).data);
}
const colours = (p) => new Set(p.map((_, i) => i % 4 ? 0 : p.slice(i, i + 3).join())).size;
const changed = (a, b) => a.filter((v, i) => Math.abs(v - b[i]) > 8).length;
const lines = () => [...document.querySelectorAll(".cursor")];
const cursors = () => lines().map((c) => [c.style.display, c.style.left]);
async function probe() {
  const seen = window.seen;
  await frame();
  const first = picture();
  seen.colours = colours(first);
  seen.middle = first.slice(4 * (96 * 20 + 48), 4 * (96 * 20 + 48) + 3);
  seen.startText = part("time").textContent;
  seen.startCursors = cursors();
  part("slider").value = 3.1;
  part("slider").dispatchEvent(new Event("input"));
  await frame();
  const second = picture();
  seen.movedPixels = changed(first, second);
  seen.movedText = part("time").textContent;
  seen.movedCursors = cursors();
  seen.now = part("now").textContent;
  const plot = document.querySelector("#com .plot");
  const box = plot.getBoundingClientRect();
  const [x0, x1] = JSON.parse(plot.dataset.axes)[0];
  const middle = box.left + box.width * (x0 + x1) / 2;
  plot.dispatchEvent(new MouseEvent("click", { clientX: middle, clientY: box.top + 90 }));
  seen.clickedTime = Number(part("slider").value);
  document.querySelector("button.moment")?.click();
  seen.momentText = part("time").textContent;
  seen.momentCursors = cursors();
  plot.dispatchEvent(new MouseEvent("click", { clientX: middle, clientY: box.top + 90 }));
  part("play").click();
  seen.playText = part("play").textContent;
  for (let i = 0; i < 6; i += 1) await frame();
  part("play").click();
  seen.playedTime = Number(part("slider").value);
  const box2 = part("views").querySelector('input[value="support"]');
  const before = picture();
  part("views").querySelector('button[value="top"]').click();
  await frame();
  seen.turnedPixels = changed(before, picture());
  box2.click();
  seen.sorry = !part("sorry").hidden;
  seen.width = document.documentElement.scrollWidth;
}
probe().catch((e) => window.seen.errors.push(String(e))).finally(() => {
  fetch("LISTENER", { method: "POST", mode: "no-cors", body: JSON.stringify(window.seen) });
});
</script>"""


class Listener(HTTPServer):
    """Waits on this machine for the one message of the probe."""

    seen = None

    class RequestHandlerClass(BaseHTTPRequestHandler):
        def do_POST(self):
            length = int(self.headers["Content-Length"])
            self.server.seen = json.loads(self.rfile.read(length))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_):
            pass

    def __init__(self):
        super().__init__(("127.0.0.1", 0), self.RequestHandlerClass)
        self.timeout = 40.0


def visit(record, directory, before=""):
    """Open the page of a record in the browser and return what the probe saw."""
    path = write_report(record, directory)
    with Listener() as listener:
        probe = PROBE.replace("LISTENER", f"http://127.0.0.1:{listener.server_port}/")
        page = path.read_text(encoding="utf-8")
        page = page.replace("<head>", f"<head>{COLLECT_ERRORS}{before}", 1)
        path.write_text(page.replace("</body>", f"{probe}</body>"), encoding="utf-8")
        command = [
            CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader", "--window-size=720,480", "--no-first-run",
            f"--user-data-dir={directory / 'profile'}", path.as_uri(),
        ]  # fmt: skip
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        with subprocess.Popen(command, **quiet) as browser:
            try:
                listener.handle_request()
            finally:
                browser.terminate()
        assert listener.seen is not None, "the probe did not finish"
        return listener.seen


def test_the_replay_draws_and_the_controls_move_the_time(tmp_path):
    late = Check(name="ZMP", value=1.0, bound=0.0, ok=False, time=1.75, mechanism="a slip")
    seen = visit(walking_record(duration=6.0, checks=(late,)), tmp_path)
    assert seen["errors"] == []
    assert not seen["sorry"]
    assert seen["colours"] > 50
    assert seen["startText"].startswith("0.00 s")
    assert seen["movedText"].startswith("3.10 s")
    assert seen["movedPixels"] > 20
    assert seen["now"] == "left hand target"
    assert all(display == "block" for display, _ in seen["movedCursors"])
    assert seen["movedCursors"] != seen["startCursors"]
    assert seen["clickedTime"] == pytest.approx(3.0, abs=0.05)
    assert seen["momentText"].startswith("1.75 s")
    assert seen["momentCursors"] != seen["movedCursors"]
    assert seen["playText"] == "Pause"
    # It moved on; on a slow machine it may have come to the end and begun anew.
    assert seen["playedTime"] != pytest.approx(seen["clickedTime"], abs=1e-3)
    assert seen["turnedPixels"] > 100
    assert seen["width"] <= 720


def test_without_webgl_a_sentence_stands_in_and_the_time_still_moves(tmp_path):
    seen = visit(walking_record(duration=4.0), tmp_path, before=NO_WEBGL)
    assert [e for e in seen["errors"] if "WebGL" not in e] == []
    assert seen["sorry"]
    assert seen["movedText"].startswith("3.10 s")
    assert seen["movedCursors"] != seen["startCursors"]
