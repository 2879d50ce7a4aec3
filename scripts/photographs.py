#!/usr/bin/env python3
"""Photographs through every phase: the table in docs/method/optimise.md, made again.

    cargo build --release
    python3 -m venv venv && venv/bin/pip install scikit-image
    venv/bin/python scripts/photographs.py

Takes twelve images out of the scikit-image package (nothing is downloaded but the package, and
nothing is kept), makes the phase of the merit `sum`, and runs `metalith photographs`.
"""

import pathlib
import subprocess
import tempfile

import numpy
from skimage import color, data, io, util

ROOT = pathlib.Path(__file__).resolve().parent.parent
METALITH = ROOT / "target" / "release" / "metalith"
SIDE = 300  # of the square that is cut out of the middle; the smallest image is 300 high
NAMES = [
    "astronaut.png", "brick.png", "camera.png", "chelsea.png", "coffee.png", "coins.png",
    "grass.png", "gravel.png", "hubble_deep_field.jpg", "moon.png", "motorcycle_left.png", "rocket.jpg",
]


def cut(image):
    """The middle of an image, in colour, 8 bits."""
    if image.ndim == 2:
        image = color.gray2rgb(image)
    top, left = ((length - SIDE) // 2 for length in image.shape[:2])
    return util.img_as_ubyte(image[top : top + SIDE, left : left + SIDE, :3])


def main():
    package = pathlib.Path(data.__file__).parent
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        images = []
        for name in NAMES:
            image = cut(io.imread(package / name))
            assert image.shape == (SIDE, SIDE, 3) and numpy.ptp(image) > 0, name
            images.append(folder / f"{pathlib.Path(name).stem}.png")
            io.imsave(images[-1], image, check_contrast=False)
        phases = ROOT / "designs" / "phases"
        design = (ROOT / "designs" / "broadband_3x3.toml").read_text()
        design = design.replace("phases/broadband.csv", str(phases / "broadband.csv"))
        design = design.replace("\nlog = 1.0", "\nsum = 1.0").replace("hot_sweeps", "hot_sweeps = 0 #")
        (folder / "sum.toml").write_text(design)
        subprocess.run(
            [METALITH, "optimise", folder / "sum.toml", "--no-report", "--out", folder, "--phase", folder / "sum.csv"],
            check=True, stdout=subprocess.DEVNULL,
        )
        chosen = {
            "sum": folder / "sum.csv", "log": phases / "broadband.csv",
            "deconvolution": phases / "imaging.csv", "robust": phases / "robust.csv",
        }
        arguments = [part for name, path in chosen.items() for part in ("--phase", f"{name}={path}")]
        subprocess.run([METALITH, "photographs", ROOT / "designs" / "imaging_3x3.toml", *images, *arguments], check=True)


if __name__ == "__main__":
    main()
