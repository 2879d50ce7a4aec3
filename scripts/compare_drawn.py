#!/usr/bin/env python3
"""Draw lenses with gdstk as anybody does, and compare their PSFs with those of the same lenses written by metalith.

    target/ci/bin/python scripts/compare_drawn.py METALITH FOLDER

Each lens is small, of a shipped design whose sizes are changed. Places and widths are real numbers here and are rounded to
1 nm by gdstk, corner by corner. Every pillar has to be read, and no value of the PSF may be off by more than TOLERANCE of the
peak."""

import json
import math
import pathlib
import re
import subprocess
import sys

import gdstk
import numpy as np

# Largest difference of two PSFs over the peak: half a nanometre of place and width of each pillar makes less.
TOLERANCE = 1e-3
# No design has a pitch of 1000/3 nm. The lens of 333.3 nm beside it has its outermost pillars 1.5 nm elsewhere.
TOLERANCE_OTHER_PITCH = 2e-3

ROOT = pathlib.Path(__file__).resolve().parent.parent
MINI = {
    "pitch_nm": "350",
    "width_step_nm": "10",
    "diameter_um": "30",
    "focal_length_um": "60",
    "elements": "[1, 1]",
    "basis": '"all_powers"\naccept = "both lenses have the same widths"',
}
# Design, its changed keys, wavelength (nm).
LENSES = {
    "square": ("mini_3x3", MINI, 530),
    "round": ("mini_3x3", MINI | {"pitch_nm": '350\nshape = "circle"'}, 530),
    "odd_pitch": ("mini_3x3", MINI | {"pitch_nm": "333.3", "database_unit_nm": "0.1"}, 530),
    "hexagonal": ("hexagonal_1550", {"width_step_nm": "10", "width_max_nm": "520", "diameter_um": "50", "focal_length_um": "75"}, 1550),
    "rotated": ("geometric_phase_532", {"diameter_um": "30", "focal_length_um": "80"}, 532),
}


def run(*command):
    return subprocess.run([str(c) for c in command], check=True, capture_output=True, text=True).stdout


def write_reference(name, metalith, folder):
    """The layout of a lens as metalith writes it, flat, and its design."""
    design, keys, _ = LENSES[name]
    text = (ROOT / "designs" / f"{design}.toml").read_text().replace(f'name = "{design}"', f'name = "{name}"')
    for key, value in keys.items():
        text = re.sub(rf"(?m)^{key} *= *[^#\n]*", f"{key} = {value} ", text, count=1)
    path = folder / f"{name}.toml"
    path.write_text(text)
    run(metalith, "layout", path, "--hierarchy", "flat", "--out", folder / name, "--quiet")
    return folder / name / f"{name}_pillars.gds", path


def polygons_of(path):
    """Outlines of all pillars of a layout (um)."""
    top = gdstk.read_gds(path).top_level()[0]
    return [p for p in top.get_polygons() if (p.layer, p.datatype) == (1, 0)]


def draw(path, shapes, turned_deg=None):
    """Write shapes on a grid of 1 nm; in a cell that is placed at an angle, if one is given."""
    library = gdstk.Library("drawn", 1e-6, 1e-9)
    cell = library.new_cell("LENS")
    cell.add(*shapes)
    if turned_deg is not None:
        library.new_cell("TOP").add(gdstk.Reference(cell, (12.3456, -7.8901), rotation=math.radians(turned_deg)))
    library.write_gds(path)


def square(x, y, width):
    return gdstk.rectangle((x - width / 2, y - width / 2), (x + width / 2, y + width / 2), layer=1)


def circle(x, y, width):
    return gdstk.ellipse((x, y), width / 2, tolerance=2.5e-4, layer=1)


def rectangle(x, y, degrees):
    shape = gdstk.rectangle((-0.05, -0.125), (0.05, 0.125), layer=1)
    return shape.rotate(math.radians(degrees)).translate(x, y)


def boxes(polygons):
    """Middle and width of each (um)."""
    for polygon in polygons:
        (x0, y0), (x1, y1) = polygon.bounding_box()
        yield (x0 + x1) / 2, (y0 + y1) / 2, x1 - x0


def rotation_of(polygon):
    """Rotation of a rectangle to a degree, from its longer edge."""
    edges = np.diff(np.vstack([polygon.points, polygon.points[:1]]), axis=0)
    x, y = edges[np.argmax(np.hypot(*edges.T))]
    return round(math.degrees(math.atan2(y, x)) - 90)


def by_loop(x, y, pitch, row):
    """A place of a hexagonal lattice whose rows are not rounded."""
    return x, round(y / row) * pitch * math.sqrt(3) / 2


def psf(layout, design, wavelength_nm, distance_um, metalith, out):
    """PSF of the only element of a layout, and what was said of it."""
    found = run(
        metalith, "psf", layout, "--cell", design, "--wavelength-nm", wavelength_nm, "--distance-um", distance_um,
        "--samples", "64", "--fast", "--out", out, "--json",
    )  # fmt: skip
    found = json.loads(found)
    (npy,) = out.glob("psf_0_*.npy")
    return np.load(npy), found


def main():
    metalith, folder = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    written = {name: write_reference(name, metalith, folder) for name in LENSES}
    polygons = {name: polygons_of(path) for name, (path, _) in written.items()}
    drawn = {
        "square": [square(*box) for box in boxes(polygons["square"])],
        "round": [circle(*box) for box in boxes(polygons["round"])],
        "odd_pitch": [square(*box) for box in boxes(polygons["odd_pitch"])],
        "hexagonal": [circle(*by_loop(x, y, 0.7, 0.606), w) for x, y, w in boxes(polygons["hexagonal"])],
        "rotated": [rectangle(x, y, rotation_of(p)) for p in polygons["rotated"] for x, y, _ in boxes([p])],
    }
    pairs = {name: (name, written[name][0], shapes, None) for name, shapes in drawn.items()}
    pairs["turned"] = ("square", written["square"][0], drawn["square"], 30)
    # Every corner of a lens at an angle rounded for itself, and places of a pitch that is no round number.
    turned = [square(*box).rotate(math.radians(12)).translate(12.3456, -7.8901) for box in boxes(polygons["square"])]
    pairs["flattened"] = ("square", written["square"][0], turned, None)
    scaled = 1000 / 3 / 333.3
    stretched = [square(x * scaled, y * scaled, w) for x, y, w in boxes(polygons["odd_pitch"])]
    pairs["any_pitch"] = ("odd_pitch", written["odd_pitch"][0], stretched, None)
    # Half of each: the lens on the left is of squares, that on the right of circles.
    left = [p for p in polygons["square"] if p.bounding_box()[0][0] < 0]
    right = [p for p in polygons["round"] if p.bounding_box()[0][0] >= 0]
    draw(folder / "both.gds", left + right)
    mixed = [square(*box) for box in boxes(left)] + [circle(*box) for box in boxes(right)]
    pairs["mixed"] = ("square", folder / "both.gds", mixed, None)
    failed = False
    for name, (like, reference, shapes, turned_deg) in pairs.items():
        _, keys, wavelength_nm = LENSES[like]
        layout = folder / f"{name}_drawn.gds"
        draw(layout, shapes, turned_deg)
        light = (written[like][1], wavelength_nm, keys["focal_length_um"], metalith)
        want, as_written = psf(reference, *light, folder / f"{name}_reference")
        got, as_drawn = psf(layout, *light, folder / f"{name}_drawn")
        off = np.abs(got - want).max() / want.max() if got.shape == want.shape else math.inf
        read = (as_written["pillars"], as_drawn["pillars"], len(shapes))
        allowed = TOLERANCE_OTHER_PITCH if name == "any_pitch" else TOLERANCE
        failed |= off > allowed or len(set(read)) > 1
        print(f"{name:10} {read[1]:6} of {read[2]} pillars, PSF off by {off:.1e} of the peak")
    if failed:
        sys.exit(f"pillars are missing, or PSFs are off by more than {TOLERANCE} ({TOLERANCE_OTHER_PITCH} for another pitch) of the peak")


main()
