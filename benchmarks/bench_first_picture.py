"""How long `asperity view` takes to the first picture that has the tool, beside a bare viser page.

    python benchmarks/bench_first_picture.py [--scene probe-plate] [--runs 2]

A headless Chromium, which draws by software, waits; the command starts, and its address is opened
when it is printed. The picture counts when a mesh of as many triangles as the bodies have has been
drawn and a pixel of it can be read back. Printed are seconds from the command to the address and to
the picture, and processor seconds of the command and of the browser until then, which a busy
machine changes less. The bar, 5 s from the cache, is for a free machine. Linux only (/proc).
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

from asperity.viewer.browser import browser_tab

TRIANGLES = 13_000
"""Of the largest mesh of a scene, at least."""
HOOK = """
(() => {
  window.asperityFirst = 0;
  const context = WebGL2RenderingContext.prototype, draw = context.drawElements;
  context.drawElements = function (...given) {
    draw.apply(this, given);
    if (window.asperityFirst || given[1] < 3 * TRIANGLES) return;
    window.asperityFirst = 1;
    this.readPixels(0, 0, 1, 1, this.RGBA, this.UNSIGNED_BYTE, new Uint8Array(4));
    window.asperityFirst = Date.now();
  };
})();
""".replace("TRIANGLES", str(TRIANGLES))
BARE = """
import time, trimesh, viser
server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
ball = trimesh.creation.icosphere(subdivisions=5)
server.scene.add_mesh_simple("/ball", ball.vertices, ball.faces)
print(f"http://127.0.0.1:{server.get_port()}", flush=True)
time.sleep(600)
"""


def processor_seconds(root: int) -> float:
    """Return what a process and its descendants have used [s]."""
    table = {}
    for place in Path("/proc").iterdir():
        if place.name.isdigit():
            try:
                text = (place / "stat").read_text()
            except OSError:  # it has ended
                continue
            fields = text[text.rindex(")") + 2 :].split()
            table[int(place.name)] = int(fields[1]), sum(map(int, fields[11:15]))
    total, front = 0, [root]
    while front:
        process = front.pop()
        total += table.get(process, (0, 0))[1]
        front += [child for child, (parent, _) in table.items() if parent == process]
    return total / os.sysconf("SC_CLK_TCK")


def measured(command: list[str]) -> str:
    """Return what is told of a command that prints the address of a page."""
    with browser_tab((1400, 800)) as tab:
        tab.add_init_script(HOOK)
        tab.goto("about:blank")
        before, begun = processor_seconds(os.getpid()), time.time()
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            start_new_session=True,
        ) as served:  # fmt: skip
            try:
                assert served.stdout is not None
                lines = iter(served.stdout.readline, "")
                url = next(m.group() for m in map(re.compile(r"http://\S+").search, lines) if m)
                opened = time.time() - begun
                tab.goto(url, wait_until="commit", timeout=300e3)
                while (first := tab.evaluate("window.asperityFirst || 0")) < 10:
                    time.sleep(0.02)
                own = processor_seconds(served.pid)
                browser = processor_seconds(os.getpid()) - before - own
            finally:
                os.killpg(served.pid, signal.SIGINT)
    return (
        f"address {opened:5.2f} s, picture {first / 1e3 - begun:5.2f} s; "
        f"processor: command {own:5.2f} s, browser {browser:5.2f} s"
    )


def main() -> None:
    """Print a line of each, in turn."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", default="probe-plate")
    parser.add_argument("--runs", type=int, default=2)
    given = parser.parse_args()
    view = [sys.executable, "-m", "asperity", "view", given.scene, "--no-open", "--port", "0"]
    for _ in range(given.runs):
        print(f"viser     {measured([sys.executable, '-c', BARE])}", flush=True)
        print(f"asperity  {measured(view)}, load {os.getloadavg()[0]:.1f}", flush=True)


if __name__ == "__main__":
    main()
