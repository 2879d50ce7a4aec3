#!/usr/bin/env python3
"""Make docs/report.png: figures of a report side by side, as a browser draws them.

    metalith run designs/mini_3x3.toml --out out/mini
    python3 scripts/picture.py out/mini/report.html docs/report.png

Needs Chromium on the path and nothing else. The figures are cut out of the report as they are; this script
only arranges them.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

# Title of each figure, as `aria-label` of its SVG begins, and its width in the picture in pixels.
FIGURES = [("The chip", 280), ("Pillars in the middle", 280), ("PSF designed above extracted", 540)]
SIZE = (1150, 365)


def main(report: Path, picture: Path) -> None:
    text = report.read_text(encoding="utf-8")
    style = re.search(r"<style>.*?</style>", text, re.S).group(0)
    parts = []
    for title, width in FIGURES:
        found = re.search(rf'<svg aria-label="{re.escape(title)}.*?</svg>\s*<figcaption', text, re.S)
        if not found:
            sys.exit(f"{report}: no figure whose title begins with \"{title}\": adapt FIGURES in {__file__}")
        svg = found.group(0).rsplit("<figcaption", 1)[0]
        parts.append(f'<div style="width:{width}px">{svg}</div>')
    page = (
        f'<!DOCTYPE html><meta charset="utf-8"><meta name="color-scheme" content="light">{style}'
        "<body style='margin:0;padding:12px;max-width:none;background:#fff'>"
        f"<div style='display:flex;gap:12px;align-items:center;width:{SIZE[0] - 24}px'>{''.join(parts)}</div>"
    )
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if not chromium:
        sys.exit("no Chromium on the path: install it")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "page.html"
        file.write_text(page, encoding="utf-8")
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--hide-scrollbars"]
        options += ["--disable-background-networking", f"--user-data-dir={folder}/profile"]
        options += [f"--window-size={SIZE[0]},{SIZE[1]}", f"--screenshot={picture.resolve()}", file.as_uri()]
        subprocess.run([chromium, *options], check=True, stderr=subprocess.DEVNULL, timeout=120)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
