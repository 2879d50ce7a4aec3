#!/usr/bin/env python3
"""Make a picture of figures of a report, side by side, as a browser draws them.

    picture.py REPORT.html PICTURE.png TITLE=WIDTH...

TITLE is how the title of a figure begins, WIDTH its width in the picture in pixels. The pictures of the documents:

    metalith run designs/mini_3x3.toml --out out/mini
    picture.py out/mini/report.html docs/report.png "The chip=280" "Pillars in the middle=280" "PSF designed=540"
    metalith picture out/prototype_3x3/prototype_3x3_pillars.gds astronaut.png --camera cameras/gt1930.toml \\
        --design designs/prototype_3x3.toml --field-deg 80 --no-forecast --method prior --out out/picture
    picture.py out/picture/picture.html docs/photograph.png "Scene, frame, picture=760"
    picture.py out/calibrate/control/report.html docs/ladder.png "Residual under three=760"
    picture.py out/calibrate/control/validation.html docs/proof.png "Confusion matrix=800"

Needs Chromium on the path and nothing else. The figures are cut out of the report as they are; this script only
arranges them.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

MARGIN, GAP = 12, 12


def figure(text: str, report: Path, title: str) -> tuple[str, float]:
    """The SVG whose title begins so, and its height over its width."""
    # An SVG may hold others, so the figure ends at its caption.
    found = re.search(rf'<svg aria-label="{re.escape(title)}.*?</svg>\s*(?=<figcaption)', text, re.S)
    if not found:
        titles = ", ".join(sorted(set(re.findall(r'<svg aria-label="([^"]*)"', text))))
        sys.exit(f"{report}: no figure whose title begins with \"{title}\"; there are: {titles}")
    width, height = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', found.group(0)).groups()
    return found.group(0), float(height) / float(width)


def main(report: Path, picture: Path, wanted: list[str]) -> None:
    text = report.read_text(encoding="utf-8")
    style = re.search(r"<style>.*?</style>", text, re.S).group(0)
    parts, across, down = [], 2 * MARGIN - GAP, 0
    for word in wanted:
        title, width = word.rsplit("=", 1)
        svg, ratio = figure(text, report, title)
        parts.append(f'<div style="flex:none;width:{width}px">{svg}</div>')
        across, down = across + int(width) + GAP, max(down, int(width) * ratio)
    size = across, int(down) + 1 + 2 * MARGIN
    page = (
        f'<!DOCTYPE html><meta charset="utf-8"><meta name="color-scheme" content="light">{style}'
        f"<body style='margin:0;padding:{MARGIN}px;max-width:none;background:#fff'>"
        f"<div style='display:flex;gap:{GAP}px;align-items:center'>{''.join(parts)}</div>"
    )
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if not chromium:
        sys.exit("no Chromium on the path: install it")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "page.html"
        file.write_text(page, encoding="utf-8")
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--hide-scrollbars"]
        options += ["--disable-background-networking", f"--user-data-dir={folder}/profile"]
        options += [f"--window-size={size[0]},{size[1]}", f"--screenshot={picture.resolve()}", file.as_uri()]
        subprocess.run([chromium, *options], check=True, stderr=subprocess.DEVNULL, timeout=120)


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])
