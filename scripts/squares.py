#!/usr/bin/env python3
"""Photographs of the scikit-image package as the tables of pictures take them: the largest square in the middle, resized.

    python3 -m venv venv && venv/bin/pip install scikit-image
    venv/bin/python scripts/squares.py FOLDER PIXELS [NAME...]

Writes NAME.png (8 bits, colour; grey as equal colours) for each name, of all twelve if none is given. Nothing is downloaded but the
package.
"""

import pathlib
import sys

from PIL import Image
from skimage import data

NAMES = [
    "astronaut.png", "brick.png", "camera.png", "chelsea.png", "coffee.png", "coins.png",
    "grass.png", "gravel.png", "hubble_deep_field.jpg", "moon.png", "motorcycle_left.png", "rocket.jpg",
]


def main(folder, pixels, *names):
    package, folder = pathlib.Path(data.__file__).parent, pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    known = {pathlib.Path(name).stem: name for name in NAMES}
    for name in names or known:
        image = Image.open(package / known[name]).convert("RGB")
        side = min(image.size)
        left, top = ((length - side) // 2 for length in image.size)
        square = image.crop((left, top, left + side, top + side))
        square.resize((int(pixels), int(pixels)), Image.Resampling.LANCZOS).save(folder / f"{name}.png")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
