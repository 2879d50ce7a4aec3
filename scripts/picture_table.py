#!/usr/bin/env python3
"""Photographs through a chip and a camera: a table of scores by method and zone, and the forecast beside them.

    python3 scripts/picture_table.py METALITH LAYOUT DESIGN CAMERA PHOTOGRAPHS FOLDER [--methods tikhonov,tv,hqs]
        [--field-deg 80] [--joint]

Runs `metalith picture` for every PNG and JPEG of the folder PHOTOGRAPHS, which must be of one size, and prints means over all
of them as Markdown: PSNR is that of the mean squared error over the photographs, of sRGB values and of linear light; SSIM
is the mean. Each element alone is left out with --joint. FOLDER takes the reports.
"""

import argparse
import json
import math
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

SUFFIXES = {".png", ".jpg", ".jpeg"}
ZONES = ["whole", "centre", "edge", "corner"]


def mean_db(values: list[float]) -> float:
    """PSNR of the mean squared error."""
    return -10 * math.log10(sum(10 ** (-v / 10) for v in values) / len(values))


def report_of(args: argparse.Namespace, photograph: Path, forecast: bool) -> dict:
    """The report of one photograph, with the forecast, which is the same for all, if it is wanted."""
    out = args.folder / photograph.stem
    command = [args.metalith, "picture", args.layout, photograph, "--design", args.design, "--camera", args.camera]
    command += ["--field-deg", args.field_deg, "--method", args.methods, "--out", out]
    if not args.joint:
        command.append("--separate")
    if not forecast:
        command.append("--no-forecast")
    subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)
    return json.loads((out / "picture.json").read_text(encoding="utf-8"))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ["metalith", "layout", "design", "camera", "photographs", "folder"]:
        parser.add_argument(name, type=Path)
    parser.add_argument("--methods", default="tikhonov,tv,hqs")
    parser.add_argument("--field-deg", default="80")
    parser.add_argument("--joint", action="store_true")
    args = parser.parse_args()
    photographs = sorted(p for p in args.photographs.iterdir() if p.suffix.lower() in SUFFIXES)
    if not photographs:
        print(f"{args.photographs} holds no PNG or JPEG", file=sys.stderr)
        return 2
    found = defaultdict(lambda: defaultdict(list))
    forecast = defaultdict(list)
    for photograph in photographs:
        report = report_of(args, photograph, not forecast)
        for one in report["restorations"]:
            way = (one["method"], "joint" if one["joint"] else "each alone")
            for score in one["scores"]:
                for value in ["psnr_db", "psnr_linear_db", "ssim"]:
                    found[way][score["zone"], value].append(score[value])
            for zone, db in zip(ZONES, one["forecast_db"]):
                forecast[zone].append(db)
    print(f"{len(photographs)} photographs; zones: {', '.join(ZONES)}\n")
    print("| method | elements | PSNR (dB) | SSIM | PSNR of linear light (dB) |")
    print("| --- | --- | --- | --- | --- |")
    for (method, elements), scores in found.items():
        def row(value: str, form: str, mean) -> str:
            return ", ".join(form.format(mean(scores[zone, value])) for zone in ZONES)

        plain = lambda values: sum(values) / len(values)
        cells = [row("psnr_db", "{:.2f}", mean_db), row("ssim", "{:.3f}", plain), row("psnr_linear_db", "{:.2f}", mean_db)]
        print(f"| {method} | {elements} | {' | '.join(cells)} |")
    if forecast:
        print(f"| forecast | joint | | | {', '.join(f'{forecast[zone][0]:.2f}' for zone in ZONES)} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
