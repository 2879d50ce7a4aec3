"""Layouts record by record, right or wrong, and the two clean plates that are broken: pillars, and openings over them."""
import struct

PITCH, SITES = 350, 40
PILLARS, OPENINGS, PILLAR_MARKS, OPENING_MARKS, OUTLINE, LABEL = 1, 2, 3, 4, 10, 11
DATE = (2026, 1, 1, 0, 0, 0) * 2


def record(kind, data, body=b""):
    return struct.pack(">HBB", len(body) + 4, kind, data) + body


def int2(kind, *values):
    return record(kind, 2, struct.pack(f">{len(values)}h", *values))


def int4(kind, values):
    return record(kind, 3, struct.pack(f">{len(values)}i", *values))


def ascii_(kind, text):
    return record(kind, 6, text.encode() + b"\0" * (len(text) % 2))


def real(value):
    """An 8-byte real of the format, for the small positive numbers of UNITS."""
    exponent = 64
    while value < 1 / 16:
        value, exponent = value * 16, exponent - 1
    return struct.pack(">Q", exponent << 56 | int(value * 2**56))


def boundary(layer, points):
    head = record(0x08, 0) + int2(0x0D, layer) + int2(0x0E, 0)
    return head + int4(0x10, [v for p in points for v in p]) + record(0x11, 0)


def reference(name, x, y):
    return record(0x0A, 0) + ascii_(0x12, name) + int4(0x10, (x, y)) + record(0x11, 0)


def text(layer, string, x, y):
    head = record(0x0C, 0) + int2(0x0D, layer) + int2(0x16, 0)
    return head + int4(0x10, (x, y)) + ascii_(0x19, string) + record(0x11, 0)


def cell(name, *elements):
    return int2(0x05, *DATE) + ascii_(0x06, name) + b"".join(elements) + record(0x07, 0)


class Plate:
    """One file. Functions that break it change `pillars`, add to `elements`, `before` and `after`, or set the rest."""

    def __init__(self, layer, marks):
        self.layer, self.marks = layer, marks
        self.pillars, self.lenses, self.openings, self.crosses = {}, [], [], []
        self.elements, self.before, self.after = [], [], []
        self.top, self.unit_nm = "TOP", 1

    def lens(self, column, row, columns=SITES, rows=SITES, width=lambda i, j: 160 + 2 * ((7 * i + 11 * j) % 41)):
        """Pillars from a site on, every even width from 160 to 240 nm unless told."""
        for i in range(column, column + columns):
            for j in range(row, row + rows):
                self.pillars[i, j] = [site(i), site(j), width(i, j)]
        x0, y0 = PITCH * (column - SITES // 2), PITCH * (row - SITES // 2)
        self.lenses.append((x0, y0, x0 + PITCH * columns, y0 + PITCH * rows))

    def polygon(self, layer, *points):
        self.elements.append(boundary(layer, [*points, points[0]]))

    def box(self, layer, x0, y0, x1, y1):
        self.polygon(layer, (x0, y0), (x1, y0), (x1, y1), (x0, y1))

    def square(self, layer, x, y, width):
        self.box(layer, x - width // 2, y - width // 2, x + width // 2, y + width // 2)

    def cross(self, layer, x, y, length, width):
        l, w = length // 2, width // 2
        corners = (-w, -l), (w, -l), (w, -w), (l, -w), (l, w), (w, w), (w, l), (-w, l), (-w, w), (-l, w), (-l, -w), (-w, -w)
        self.polygon(layer, *((x + dx, y + dy) for dx, dy in corners))

    def write(self, path):
        squares = []
        for opening in self.openings:
            self.box(OPENINGS, *opening)
        for x, y, length in self.crosses:
            self.cross(self.marks, x, y, length, length // 100)
        for x, y, w in self.pillars.values():
            x0, y0, x1, y1 = x - w // 2, y - w // 2, x - w // 2 + w, y - w // 2 + w
            ring = (x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)
            squares.append(boundary(PILLARS, [(round(a / self.unit_nm), round(b / self.unit_nm)) for a, b in ring]))
        units = record(0x03, 5, real(self.unit_nm * 1e-3) + real(self.unit_nm * 1e-9))
        top = cell(self.top, *squares, *self.elements)
        head = int2(0x00, 600) + int2(0x01, *DATE) + ascii_(0x02, "LIB") + units
        path.write_bytes(head + b"".join((*self.before, top, *self.after)) + record(0x04, 0))


def site(i):
    """Centre of a column or row of the lattice: the first lens is about the origin."""
    return PITCH * (2 * i - (SITES - 1)) // 2


CROSSES = [(sx * at, sy * at, length) for length, at in ((1_000_000, 4_300_000), (200_000, 3_400_000))
           for sx, sy in ((-1, -1), (1, -1), (-1, 1), (1, 1))]


def clean_pillars(lenses=1):
    plate = Plate(PILLARS, PILLAR_MARKS)
    for k in range(lenses):
        plate.lens(500 * k, 0)
    plate.crosses = list(CROSSES)
    plate.box(OUTLINE, -5_000_000, -5_000_000, 5_000_000, 5_000_000)
    plate.elements.append(text(LABEL, "label", 0, -4_600_000))
    return plate


def clean_openings(lenses):
    """An opening round each lens of the pillars, 2 um from them."""
    plate = Plate(OPENINGS, OPENING_MARKS)
    plate.lenses, plate.crosses = list(lenses), list(CROSSES)
    plate.openings = [[x0 - 2000, y0 - 2000, x1 + 2000, y1 + 2000] for x0, y0, x1, y1 in lenses]
    return plate
