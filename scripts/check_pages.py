"""Open pages in headless Chromium, light, dark and as on a phone, and name what is wrong with them.

    check_pages.py FOLDER SITE PAGE...

A page is wrong if it is wider than its window, if a script of it fails, or if axe finds a fault of accessibility in it. PAGE is a path
below SITE, which is served on this machine meanwhile. FOLDER keeps axe, which comes from npm. Needs Chromium and npm on the path; without them the pages are not checked, and the last line says so.
"""

import functools
import html
import http.server
import json
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import threading
from pathlib import Path

AXE = "axe-core@4.10.3"
WINDOWS = [(1200, "light"), (1200, "dark"), (390, "light"), (390, "dark")]
# Runs in the page, and leaves its findings in an element.
ASK = """
window.metalithFaults = [];
window.addEventListener("error", e => window.metalithFaults.push("script: " + e.message));
window.addEventListener("load", async () => {
  const found = window.metalithFaults;
  const wide = document.documentElement.scrollWidth, window_ = document.documentElement.clientWidth;
  if (wide > window_ + 1) found.push(`${wide} px wide in a window of ${window_} px`);
  const answer = await axe.run(document, {runOnly: ["wcag2a", "wcag2aa"]});
  for (const v of answer.violations)
    found.push(`${v.id}: ${v.help}: ${v.nodes.length} elements, first ${v.nodes[0].html.slice(0, 160)}`);
  const out = document.createElement("script");
  out.type = "application/json"; out.id = "metalith-faults"; out.textContent = JSON.stringify(found);
  document.body.append(out);
});
"""


def axe_in(folder: Path) -> str | None:
    """The script of axe, brought by npm where it is not there yet."""
    script = folder / "package/axe.min.js"
    if not script.is_file():
        if not shutil.which("npm"):
            return None
        folder.mkdir(parents=True, exist_ok=True)
        name = subprocess.run(["npm", "pack", "--silent", AXE], cwd=folder, capture_output=True, text=True, timeout=120)
        if name.returncode != 0:
            return None
        with tarfile.open(folder / name.stdout.split()[-1]) as package:
            package.extract("package/axe.min.js", folder, filter="data")
    return script.read_text()


class Served(http.server.SimpleHTTPRequestHandler):
    """Files of a site; a page with `?asked` gets the scripts that look for its faults."""

    scripts = ""

    def do_GET(self) -> None:
        path, _, query = self.path.partition("?")
        if query != "asked":
            return super().do_GET()
        text = Path(self.translate_path(path)).read_text()
        head = re.compile(r"<head[^>]*>")
        body = (head.sub(lambda m: m[0] + self.scripts, text, count=1) if head.search(text) else self.scripts + text).encode()
        self.send_response(200)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        """Nothing: requests are no news."""


def drawn(address: str, chromium: str, options: list[str]) -> str:
    """What Chromium makes of a page; nothing if it does not start."""
    with tempfile.TemporaryDirectory() as profile:
        quiet = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]
        try:
            command = [chromium, *quiet, f"--user-data-dir={profile}", *options, "--dump-dom", address]
            return subprocess.run(command, capture_output=True, text=True, timeout=120).stdout
        except (OSError, subprocess.TimeoutExpired):
            return ""


def faults(address: str, chromium: str, width: int, colours: str) -> list[str]:
    """What is wrong with a page in a window."""
    options = [f"--window-size={width},1200", "--virtual-time-budget=20000"]
    if colours == "dark":
        options.append("--blink-settings=preferredColorScheme=0")
    text = drawn(address, chromium, options)
    found = re.search(r'<script type="application/json" id="metalith-faults">(.*?)</script>', text, re.S)
    return json.loads(html.unescape(found[1])) if found else ["the page was not drawn"]


def main(folder: Path, site: Path, pages: list[str]) -> int:
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    axe = chromium and axe_in(folder)
    if not axe or "<html" not in drawn("data:text/html,<p>", chromium, []):
        print(f"{len(pages)} pages are NOT checked: Chromium that starts, and npm, are needed")
        return 0
    Served.scripts = f"<script>{axe}</script><script>{ASK}</script>"
    handler = functools.partial(Served, directory=str(site))
    wrong = 0
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        for page in pages:
            for width, colours in WINDOWS:
                address = f"http://127.0.0.1:{server.server_port}/{page}?asked"
                for fault in faults(address, chromium, width, colours):
                    wrong += 1
                    print(f"{page}, {width} px, {colours}: {fault}")
        server.shutdown()
    print(f"{len(pages)} pages in {len(WINDOWS)} windows: {wrong} faults")
    return 1 if wrong else 0


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:]))
