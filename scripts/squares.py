#!/usr/bin/env python3
"""Photographs of the scikit-image package as the tables of pictures take them: the largest square in the middle, resized.

    python3 -m venv venv && venv/bin/pip install scikit-image
    venv/bin/python scripts/squares.py FOLDER PIXELS [NAME...]

Writes NAME.png (8 bits, colour; grey as equal colours) for each name, of all twelve if none is given. Nothing is downloaded but the
package.
"""

import pathlib
import sys

from skimage import color, data, io, transform, util

NAMES = [
    "astronaut.png", "brick.png", "camera.png", "chelsea.png", "coffee.png", "coins.png",
    "grass.png", "gravel.png", "hubble_deep_field.jpg", "moon.png", "motorcycle_left.png", "rocket.jpg",
]


def main(folder, pixels, *names):
    package, folder = pathlib.Path(data.__file__).parent, pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    known = {pathlib.Path(name).stem: name for name in NAMES}
    for name in names or known:
        image = io.imread(package / known[name])
        image = color.gray2rgb(image) if image.ndim == 2 else image[..., :3]
        side = min(image.shape[:2])
        top, left = ((length - side) // 2 for length in image.shape[:2])
        square = image[top : top + side, left : left + side]
        square = transform.resize(square, (int(pixels), int(pixels)), anti_aliasing=True)
        io.imsave(folder / f"{name}.png", util.img_as_ubyte(square), check_contrast=False)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
