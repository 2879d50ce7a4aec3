"""Small layouts of one and the same lens written by gdstk and KLayout, flat and referenced, for the reader's tests.

usage: make_foreign_layouts.py [FOLDER]     (default golden/foreign; needs pip install gdstk klayout)

Every file holds, with all references followed, the lens that `width_nm` below gives, centred at CENTRE, pillars
on 1/0, one aperture polygon on 2/0 and one text on 10/0.
"""
import datetime
import math
import sys
from pathlib import Path

import gdstk
from gdstk import Library
import klayout.db as db

PITCH, HALF, CENTRE = 350, 12, (5000, -3000)  # nm, sites on each side of the middle, nm


def width_nm(h2):
    """Width from the squared distance in half pitches: the same at all eight mirrored places."""
    return 100 + 2 * (7 * h2 % 101)


def sites():
    for iy in range(-HALF, HALF):
        for ix in range(-HALF, HALF):
            h2 = (2 * ix + 1) ** 2 + (2 * iy + 1) ** 2
            if h2 <= (2 * HALF) ** 2:
                yield ix, iy, (2 * ix + 1) * PITCH // 2, (2 * iy + 1) * PITCH // 2, width_nm(h2)


SITES = list(sites())
RING = [(round(5000 * math.cos(k * math.pi / 16)), round(5000 * math.sin(k * math.pi / 16))) for k in range(32)]
UM = 1e-3


def gdstk_square(x, y, w):
    return gdstk.rectangle(((x - w / 2) * UM, (y - w / 2) * UM), ((x + w / 2) * UM, (y + w / 2) * UM), layer=1)


def gdstk_file(path, fill, unit=1e-6, precision=1e-9):
    library = Library("FOREIGN", unit, precision)
    top, lens = library.new_cell("TOP"), library.new_cell("LENS")
    fill(library, lens)
    lens.add(gdstk.Polygon([(x * UM, y * UM) for x, y in RING], layer=2))
    lens.add(gdstk.Label("lens", (0, 0), layer=10))
    top.add(gdstk.Reference(lens, (CENTRE[0] * UM, CENTRE[1] * UM)))
    library.write_gds(path, timestamp=datetime.datetime(2026, 1, 1))


def gdstk_flat(_library, lens):
    lens.add(*[gdstk_square(x, y, w) for _, _, x, y, w in SITES])


def gdstk_width_cells(library, scale=1.0):
    cells = {}
    for w in sorted({s[4] for s in SITES}):
        cells[w] = library.new_cell(f"W{w}")
        cells[w].add(gdstk_square(0, 0, w / scale))
    return cells


def gdstk_sref(library, lens):
    cells = gdstk_width_cells(library)
    lens.add(*[gdstk.Reference(cells[w], (x * UM, y * UM)) for _, _, x, y, w in SITES])


def gdstk_magnified(library, lens):
    """Cells of twice the size, halved, mirrored and turned by a quarter."""
    cells = gdstk_width_cells(library, scale=0.5)
    lens.add(*[gdstk.Reference(cells[w], (x * UM, y * UM), rotation=math.pi / 2, magnification=0.5, x_reflection=True)
               for _, _, x, y, w in SITES])


def gdstk_octants(library, lens):
    """An eighth placed eight times, the diagonal four times."""
    octant, diagonal = library.new_cell("OCT"), library.new_cell("DIAG")
    octant.add(*[gdstk_square(x, y, w) for ix, iy, x, y, w in SITES if 0 <= iy < ix])
    diagonal.add(*[gdstk_square(x, y, w) for ix, iy, x, y, w in SITES if 0 <= iy == ix])
    for k in range(4):
        for mirror in (False, True):
            lens.add(gdstk.Reference(octant, rotation=k * math.pi / 2, x_reflection=mirror))
        lens.add(gdstk.Reference(diagonal, rotation=k * math.pi / 2))


def gdstk_arrays(library, lens):
    cells = gdstk_width_cells(library)
    rows = {}
    for _, _, x, y, w in SITES:
        rows.setdefault((y, w), []).append(x)
    for (y, w), places in rows.items():
        while places:
            x = places.pop(0)
            n = 1
            while x + n * PITCH in places:
                places.remove(x + n * PITCH)
                n += 1
            lens.add(gdstk.Reference(cells[w], (x * UM, y * UM), columns=n, rows=1, spacing=(PITCH * UM, PITCH * UM)))


def klayout_file(path, fill, dbu=0.001):
    layout = db.Layout()
    layout.dbu = dbu
    nm = round(0.001 / dbu)
    top, lens = layout.create_cell("TOP"), layout.create_cell("LENS")
    fill(layout, lens, layout.layer(1, 0), nm)
    lens.shapes(layout.layer(2, 0)).insert(db.Polygon([db.Point(x * nm, y * nm) for x, y in RING]))
    lens.shapes(layout.layer(10, 0)).insert(db.Text("lens", 0, 0))
    top.insert(db.CellInstArray(lens.cell_index(), db.Trans(CENTRE[0] * nm, CENTRE[1] * nm)))
    options = db.SaveLayoutOptions()
    options.format, options.gds2_write_timestamps, options.write_context_info = "GDS2", False, False
    layout.write(str(path), options)


def box(x, y, w, nm):
    return db.Box((x - w // 2) * nm, (y - w // 2) * nm, (x + w // 2) * nm, (y + w // 2) * nm)


def klayout_flat(_layout, lens, layer, nm):
    for _, _, x, y, w in SITES:
        lens.shapes(layer).insert(box(x, y, w, nm))


def klayout_sref(layout, lens, layer, nm):
    cells = {}
    for _, _, x, y, w in SITES:
        if w not in cells:
            cells[w] = layout.create_cell(f"WIDTH_{w}")
            cells[w].shapes(layer).insert(box(0, 0, w, nm))
        lens.insert(db.CellInstArray(cells[w].cell_index(), db.Trans(x * nm, y * nm)))


def klayout_octants(layout, lens, layer, nm):
    octant, diagonal = layout.create_cell("OCT"), layout.create_cell("DIAG")
    for ix, iy, x, y, w in SITES:
        if 0 <= iy < ix:
            octant.shapes(layer).insert(box(x, y, w, nm))
        if 0 <= iy == ix:
            diagonal.shapes(layer).insert(box(x, y, w, nm))
    for k in range(8):
        lens.insert(db.CellInstArray(octant.cell_index(), db.Trans(k % 4, k > 3, 0, 0)))
    for k in range(4):
        lens.insert(db.CellInstArray(diagonal.cell_index(), db.Trans(k, False, 0, 0)))


def klayout_paths(_layout, lens, layer, nm):
    """Every square drawn as a path as long as it is wide."""
    for _, _, x, y, w in SITES:
        ends = [db.Point((x - w // 2) * nm, y * nm), db.Point((x + w // 2) * nm, y * nm)]
        lens.shapes(layer).insert(db.Path(ends, w * nm))


def main():
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "golden/foreign")
    out.mkdir(parents=True, exist_ok=True)
    gdstk_file(out / "gdstk_flat.gds", gdstk_flat)
    gdstk_file(out / "gdstk_sref.gds", gdstk_sref)
    gdstk_file(out / "gdstk_magnified.gds", gdstk_magnified)
    gdstk_file(out / "gdstk_octants.gds", gdstk_octants)
    gdstk_file(out / "gdstk_arrays.gds", gdstk_arrays)
    gdstk_file(out / "gdstk_half_nm.gds", gdstk_flat, precision=0.5e-9)
    klayout_file(out / "klayout_flat.gds", klayout_flat)
    klayout_file(out / "klayout_sref.gds", klayout_sref)
    klayout_file(out / "klayout_octants.gds", klayout_octants)
    klayout_file(out / "klayout_paths.gds", klayout_paths)
    klayout_file(out / "klayout_quarter_nm.gds", klayout_flat, dbu=0.00025)


main()
