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


def gdstk_file(path, fill, unit=1e-6, precision=1e-9, compression=6):
    library = Library("FOREIGN", unit, precision)
    top, lens = library.new_cell("TOP"), library.new_cell("LENS")
    fill(library, lens)
    lens.add(gdstk.Polygon([(x * UM, y * UM) for x, y in RING], layer=2))
    lens.add(gdstk.Label("lens", (0, 0), layer=10))
    top.add(gdstk.Reference(lens, (CENTRE[0] * UM, CENTRE[1] * UM)))
    if path.suffix == ".oas":
        library.write_oas(path, compression_level=compression, validation="crc32" if compression else "checksum32")
    else:
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


def klayout_file(path, fill, dbu=0.001, compression=0, strict=True, blocks=True):
    layout = db.Layout()
    layout.dbu = dbu
    nm = round(0.001 / dbu)
    top, lens = layout.create_cell("TOP"), layout.create_cell("LENS")
    fill(layout, lens, layout.layer(1, 0), nm)
    lens.shapes(layout.layer(2, 0)).insert(db.Polygon([db.Point(x * nm, y * nm) for x, y in RING]))
    lens.shapes(layout.layer(10, 0)).insert(db.Text("lens", 0, 0))
    top.insert(db.CellInstArray(lens.cell_index(), db.Trans(CENTRE[0] * nm, CENTRE[1] * nm)))
    options = db.SaveLayoutOptions()
    options.gds2_write_timestamps, options.write_context_info = False, False
    options.format = "OASIS" if path.suffix == ".oas" else "GDS2"
    options.oasis_compression_level, options.oasis_strict_mode, options.oasis_write_cblocks = compression, strict, blocks
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
    # Names in tables and not, behind and before their use, blocks and none, lists and none, with and without checksums.
    gdstk_file(out / "gdstk_flat.oas", gdstk_flat)
    gdstk_file(out / "gdstk_sref.oas", gdstk_sref, compression=0)
    gdstk_file(out / "gdstk_magnified.oas", gdstk_magnified)
    gdstk_file(out / "gdstk_octants.oas", gdstk_octants)
    gdstk_file(out / "gdstk_arrays.oas", gdstk_arrays)
    klayout_file(out / "klayout_flat.oas", klayout_flat)
    klayout_file(out / "klayout_lists.oas", klayout_flat, compression=10)
    klayout_file(out / "klayout_sref.oas", klayout_sref, compression=2, strict=False, blocks=False)
    klayout_file(out / "klayout_octants.oas", klayout_octants, strict=False)
    klayout_file(out / "klayout_paths.oas", klayout_paths, compression=1)
    klayout_file(out / "klayout_quarter_nm.oas", klayout_flat, dbu=0.00025)
    (out / "forms.oas").write_bytes(oasis_file(forms()))
    layout = db.Layout()
    layout.read(str(out / "forms.oas"))
    options = db.SaveLayoutOptions()
    options.gds2_write_timestamps, options.write_context_info = False, False
    layout.write(str(out / "forms.gds"), options)


def unsigned(value):
    out = bytearray()
    while value >= 0x80:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def signed(value):
    return unsigned(abs(value) << 1 | (value < 0))


def forms():
    """Records of one cell, each form 1000 further right."""
    records, x = [b"\x0e\x03TOP"], 0

    def place():
        nonlocal x
        x += 1000
        return signed(x) + signed(-500)

    for vertical in (0x80, 0):
        for a, b in ((30, 20), (-30, 20), (30, -20), (-30, -20), (0, 40)):
            size = unsigned(200) + unsigned(100)
            info = bytes([0x7B | vertical, 1, 0])
            records.append(b"\x17" + info + size + signed(a) + signed(b) + place())
            records.append(b"\x18" + info + size + signed(a) + place())
            records.append(b"\x19" + info + size + signed(b) + place())
    for form in range(26):
        width, height = (300, 100) if form < 8 else (100, 300)
        size = (0x40, unsigned(width)) if form in (16, 17, 18, 19, 22, 23, 25) else \
            (0x20, unsigned(height)) if form in (20, 21) else (0x60, unsigned(width) + unsigned(height))
        records.append(b"\x1a" + bytes([0x9B | size[0], 1, 0, form]) + size[1] + place())
    lists = [  # a type and what follows it
        (0, [signed(100), signed(50), signed(40), signed(70)]),
        (1, [signed(100), signed(50), signed(40), signed(70)]),
        (2, [unsigned(100 << 2), unsigned(50 << 2 | 1), unsigned(30 << 2 | 2)]),
        (3, [unsigned(100 << 3), unsigned(50 << 3 | 5), unsigned(50 << 3 | 6)]),
        (4, [unsigned(100 << 4), unsigned(50 << 2 | 3) + signed(77), unsigned(20 << 4 | 5 << 1)]),
        (5, [unsigned(100 << 4), unsigned(50 << 2 | 3) + signed(77), unsigned(90 << 4 | 2 << 1)]),
    ]
    for kind, points in lists:
        listed = unsigned(kind) + unsigned(len(points)) + b"".join(points)
        records.append(b"\x15" + bytes([0x3B, 1, 0]) + listed + place())
    return b"".join(records)


def oasis_file(records):
    start = b"%SEMI-OASIS\r\n\x01\x031.0\x00" + unsigned(1000) + b"\x01"
    end = b"\x02" + bytes(12)
    padding = 256 - len(end) - 2 - 1
    return start + records + end + unsigned(padding) + bytes(padding) + b"\x00"


main()
