"""What KLayout finds: for each check of `metalith check` the same question put to KLayout's own regions."""
import re
from collections import Counter

import klayout.db as db

from .plate import PITCH

EUCLIDIAN = db.Region.Euclidian


def ring(points):
    """An outline from its smallest corner, in the direction that comes first, doubled vertices once."""
    points = [p for k, p in enumerate(points) if p != points[k - 1]] or points[:1]
    turned = []
    for way in (points, points[::-1]):
        start = way.index(min(way))
        turned.append(tuple(way[start:] + way[:start]))
    return min(turned)


def corners(polygon):
    return [(p.x, p.y) for p in polygon.each_point_hull()]


def rings(shapes):
    return [ring(corners(p)) for p in shapes]


def boxes(shapes):
    return [ring(corners(db.Polygon(p.bbox()))) for p in shapes]


class View:
    """A file as KLayout reads it; `with_` is a second one on the same glass."""

    def __init__(self, path, deck, lenses, with_=None):
        self.layers, self.height_nm = deck["layers"], deck["pillar_height_nm"]
        self.lenses, self.files = lenses, []
        for file in filter(None, (path, with_)):
            layout = db.Layout()
            layout.read(str(file))
            self.files.append(layout)
        self.layout = self.files[0]
        self.unit_nm = self.layout.dbu * 1e3

    def units(self, nm):
        return round(nm / self.unit_nm)

    def numbers(self, names):
        return [tuple(map(int, self.layers[name].split("/"))) for name in names]

    def polygons(self, *names):
        """All shapes of some layers as they are drawn, one by one."""
        for number in self.numbers(names):
            for layout in self.files:
                for top in layout.top_cells():
                    for shape in top.begin_shapes_rec(layout.layer(*number)).each():
                        if not shape.shape().is_text():
                            yield shape.shape().polygon.transformed(shape.trans())

    def region(self, *names):
        """The same as a region."""
        region = db.Region(list(self.polygons(*names)))
        region.merged_semantics = False
        return region

    def named(self, rule):
        return rule.get("layers", [rule.get("layer", "pillars")])

    def shapes(self, rule):
        return self.region(*self.named(rule))

    def each(self, rule, holds):
        """Shapes of which something holds."""
        return rings(p for p in self.polygons(*self.named(rule)) if holds(p))

    def each_alone(self, rule, found):
        """Shapes in which a check finds something, each looked at by itself."""
        return self.each(rule, lambda p: not found(alone(p)).is_empty())

    def lens_of(self, box):
        """Number of the lens that a place belongs to."""
        x, y = box.center().x * self.unit_nm, box.center().y * self.unit_nm
        return next((k for k, (x0, y0, x1, y1) in enumerate(self.lenses)
                     if x0 - 5000 <= x <= x1 + 5000 and y0 - 5000 <= y <= y1 + 5000), None)

    def lens_hulls(self):
        """The pillars of each lens grown together, as a box."""
        pillars = self.region("pillars").sized(self.units(150)).merged()
        return db.Region([p.bbox() for p in pillars.each()]).sized(-self.units(150))

    def neighbours(self, shapes, place):
        """The shapes that a place between shapes touches."""
        return tuple(sorted(ring(corners(p)) for p in shapes.each() if p.bbox().touches(place)))


def alone(polygon):
    region = db.Region(polygon)
    region.merged_semantics = False
    return region


# Widths

def width_min(view, rule):
    return view.each_alone(rule, lambda r: r.width_check(view.units(rule["nm"])))


def width_max(view, rule):
    return rings(view.shapes(rule).with_bbox_max(view.units(rule["nm"]) + 1, None, False).each())


def aspect_max(view, rule):
    least = -int(-view.height_nm // rule["ratio"])
    return rings(view.shapes(rule).with_bbox_min(None, least, False).each())


def width_library(view, rule):
    first, last = rule["range_nm"]
    forbidden = [w for a, b in zip(rule["forbidden_nm"][::2], rule["forbidden_nm"][1::2]) for w in range(a, b + 1)]
    wrong = [w for w in range(first, last + 1) if (w - first) % rule["step_nm"] or w in forbidden]
    shapes = view.shapes(rule)
    return [r for w in wrong for r in rings(shapes.with_bbox_min(w, False).each())]


def exposure_grid(view, rule):
    return view.each(rule, lambda p: p.bbox().width() % rule["beam_step_nm"])


# Outlines

def doubled(polygon):
    points = corners(polygon)
    # The reader makes four corners of a rectangle without width.
    return not polygon.is_box() and any(p == points[k - 1] for k, p in enumerate(points))


def acute_angle(view, rule):
    sharp = 180 - rule["min_deg"]
    both = lambda r: r.corners_dots(sharp, 180, False, True) + r.corners_dots(-180, -sharp, True, False)
    return view.each_alone(rule, both)


def collinear_vertex(view, rule):
    def needless(p):
        once = ring(corners(p))
        return p.area() > 0 and len(once) > db.Polygon([db.Point(*c) for c in once]).num_points()
    return view.each(rule, needless)


def grid(view, rule):
    step = view.units(rule["nm"])
    return view.each_alone(rule, lambda r: r.grid_check(step, step))


# Spacing

def pairs(view, shapes, found):
    return list({view.neighbours(shapes, pair.bbox()) for pair in found.each()})


def gap_min(view, rule, nm=None):
    shapes = view.shapes(rule)
    return pairs(view, shapes, shapes.isolated_check(view.units(nm or rule["nm"]), False, EUCLIDIAN))


def gap_aspect_max(view, rule):
    return gap_min(view, rule, -int(-view.height_nm // rule["ratio"]))


def copies(shapes):
    return {r: n for r, n in Counter(rings(shapes.each())).items() if n > 1}


def overlap(view, rule):
    shapes = view.shapes(rule)
    twice = copies(shapes)
    return [r for r in rings(shapes.merged(False, 2).each()) if r not in twice]


# Density and fields

def windows(view, rule):
    """Place and fill of each window about the middle of the lens in which no pillar is missing."""
    (x0, y0, x1, _), pitch = view.lenses[0], PITCH
    sites = int(rule["window_um"] * 1000 / pitch)
    side, count = sites * pitch, round((x1 - x0) / pitch) // sites
    pillars, found = view.region("pillars"), {}
    for i in range(count):
        for j in range(count):
            tile = db.Box(x0 + i * side, y0 + j * side, x0 + (i + 1) * side, y0 + (j + 1) * side)
            inside = pillars & db.Region(tile)
            if inside.count() == sites * sites:
                found[i, j] = tile, inside.area() / tile.area()
    return found


def fill(view, rule):
    low, high = rule["range"]
    return [ring(corners(db.Polygon(tile))) for tile, share in windows(view, rule).values() if not low <= share <= high]


def fill_gradient(view, rule):
    found, steep = windows(view, rule), []
    for (i, j), (tile, share) in found.items():
        for beside, other in filter(None, (found.get((i + 1, j)), found.get((i, j + 1)))):
            if abs(share - other) > rule["max"]:
                steep.append(ring(corners(db.Polygon(tile + beside))))
    return steep


def boundaries(view, rule, lens):
    """Lines between the fields about the middle of a lens."""
    (x0, y0, x1, y1), size = view.lenses[lens], rule["field_um"] * 1e3
    shift = [1e3 * v for v in rule.get("offset_um", (0, 0))]
    lines = db.Edges()
    for axis, (low, high) in enumerate(((x0, x1), (y0, y1))):
        first = (low + high) / 2 + shift[axis] + size / 2
        for k in range(int((low - first) // size), int((high - first) // size) + 2):
            at = round(first + k * size)
            if low < at < high:
                lines.insert(db.Edge(at, y0, at, y1) if axis == 0 else db.Edge(x0, at, x1, at))
    return lines


def field_cut(view, rule):
    shapes, cut = view.region("pillars"), []
    for lens in range(len(view.lenses)):
        # What only touches a boundary is not cut.
        cut += rings(shapes.interacting(boundaries(view, rule, lens).inside_part(shapes)).each())
    return cut


def field_in_lens(view, rule):
    return [k for k in range(len(view.lenses)) if not boundaries(view, rule, k).is_empty()]


def on_lattice(view, rule):
    pitch, (x0, y0, _, _) = rule["pitch_nm"], view.lenses[0]
    off = lambda v, first: (v - first - pitch // 2) % pitch
    return view.each(rule, lambda p: off(p.bbox().center().x, x0) or off(p.bbox().center().y, y0))


# Openings and marks

def metal_on_pillars(view, rule):
    return list({view.lens_of(p.bbox()) for p in view.region("pillars").not_inside(view.shapes(rule)).each()})


def aperture_margin(view, rule):
    near = view.shapes(rule).enclosing_check(view.region("pillars"), view.units(rule["nm"]), False, EUCLIDIAN)
    # Where metal is on pillars, that rule says so.
    return list({view.lens_of(pair.bbox()) for pair in near.each()} - set(metal_on_pillars(view, rule)))


def aperture_each(view, rule):
    openings, hulls = view.shapes(rule), view.lens_hulls()
    middle = lambda p: alone(db.Polygon(db.Box(p.bbox().center(), p.bbox().center()).enlarged(1)))
    lost = openings.not_interacting(sum((middle(p) for p in hulls.each()), db.Region()))
    return rings(lost.each()) + rings(p for p in hulls.each() if openings.interacting(middle(p)).count() > 1)


def mark_keep_out(view, rule):
    # Marks are looked for by scans all round them, so the place between the arms counts. Just at the limit is far enough.
    zone = view.region(rule["layer"]).extents().sized(view.units(rule["um"] * 1e3) - 1)
    return boxes(view.shapes({"layers": rule["layers"]}).interacting(zone).each())


def marks_complete(view, rule):
    marks, known, found = view.region(rule["layer"]), db.Region(), []
    for um, wanted in zip(rule["length_um"], rule["count"]):
        size = view.units(um * 1e3)
        these = marks.with_bbox_width(size, False).with_bbox_height(size, False)
        known += these
        if these.count() != wanted:
            found.append(f"{these.count()} marks of {um} um")
    return found + boxes(marks.not_interacting(known).each())


# Layers

def layers_known(view, rule):
    known = view.numbers(rule["layers"])
    top = view.layout.top_cell()
    used = [i for i in view.layout.layer_infos() if not top.begin_shapes_rec(view.layout.layer(i)).at_end()]
    return [f"{i.layer}/{i.datatype}" for i in used if (i.layer, i.datatype) not in known]


def active_area(view, rule):
    area = db.Region(db.Box(*(view.units(v * 1e3) for v in rule["um"])))
    return boxes(view.shapes(rule).not_inside(area).each())


def no_text_exposed(view, rule):
    top = view.layout.top_cell()
    texts = [db.Texts(top.begin_shapes_rec(view.layout.layer(*n))) for n in view.numbers(rule["layers"])]
    return [((t.trans.disp.x, t.trans.disp.y),) for some in texts for t in some.each()]


# Cells and budgets

def cell_names(view, rule):
    legal = re.compile(r"[A-Za-z0-9_?$]{1,%d}" % rule["longest"])
    return [c.name for c in view.layout.each_cell() if not legal.fullmatch(c.name)]


def depth_max(view, rule):
    return [view.layout.top_cell().hierarchy_levels() + 1]


def references_max(view, rule):
    return [sum(1 for c in view.layout.each_cell() for _ in c.each_inst())]


def one_top(view, rule):
    tops = sorted(c.name for c in view.layout.top_cells())
    return tops if len(tops) != 1 else []


def dangling(view, rule):
    return [c.name for c in view.layout.each_cell() if c.is_ghost_cell()]


def shape_count(view, rule):
    top, layout = view.layout.top_cell(), view.layout
    return [sum(not s.shape().is_text() for layer in layout.layer_indexes() for s in top.begin_shapes_rec(layer).each())]


def write_time(view, rule):
    shapes = view.shapes(rule)
    exposure_s = rule["dose_uc_cm2"] * shapes.area() * 1e-14 / rule["current_na"] * 1e3
    fields = sum((-int(-(x1 - x0) // (rule["field_um"] * 1e3))) ** 2 for x0, _, x1, _ in view.lenses)
    return [(exposure_s + shapes.count() * rule["shape_ns"] * 1e-9 + fields * rule["field_s"]) / 3600]


# How findings are compared: by outline, by bounding box, by the two shapes that are too near, by the lens they
# are in, by name, or by the number that is held to a limit. A file that KLayout refuses has been found out, too.
OUTLINE, BOX, PAIR, LENS, NAME, NUMBER, REFUSED = "outline", "box", "pair", "lens", "name", "number", "refused"

EXPRESSIONS = {
    "width_min": (OUTLINE, "width_check", width_min),
    "width_max": (OUTLINE, "with_bbox_max", width_max),
    "aspect_max": (OUTLINE, "with_bbox_min", aspect_max),
    "width_library": (OUTLINE, "with_bbox_min, each width", width_library),
    "square": (OUTLINE, "non_squares", lambda v, r: rings(v.shapes(r).non_squares().each())),
    "on_lattice": (OUTLINE, "centre of each box", on_lattice),
    "exposure_grid": (OUTLINE, "width of each box", exposure_grid),
    "gap_min": (PAIR, "isolated_check, Euclidian", gap_min),
    "gap_aspect_max": (PAIR, "isolated_check, Euclidian", gap_aspect_max),
    "overlap": (OUTLINE, "merged, two at least, less duplicates", overlap),
    "duplicate": (OUTLINE, "equal polygons counted", lambda v, r: list(copies(v.shapes(r)))),
    "grid": (OUTLINE, "grid_check", grid),
    "manhattan": (OUTLINE, "non_rectilinear", lambda v, r: rings(v.shapes(r).non_rectilinear().each())),
    "acute_angle": (OUTLINE, "corners_dots, to both sides", acute_angle),
    "self_crossing": (OUTLINE, "strange_polygon_check", lambda v, r: v.each_alone(r, db.Region.strange_polygon_check)),
    "doubled_vertex": (OUTLINE, "vertices of each polygon", lambda v, r: v.each(r, doubled)),
    "collinear_vertex": (OUTLINE, "vertices of each polygon, compressed", collinear_vertex),
    "zero_area": (OUTLINE, "area of each polygon", lambda v, r: v.each(r, lambda p: p.area() == 0)),
    "vertices_max": (OUTLINE, "num_points", lambda v, r: v.each(r, lambda p: p.num_points() >= r["count"])),
    "fill": (OUTLINE, "area in each window", fill),
    "fill_gradient": (OUTLINE, "area in each window", fill_gradient),
    "field_cut": (OUTLINE, "interacting(boundaries.inside_part)", field_cut),
    "field_in_lens": (LENS, "boundaries in the box of each lens", field_in_lens),
    "aperture_margin": (LENS, "enclosing_check, Euclidian", aperture_margin),
    "metal_on_pillars": (LENS, "not_inside", metal_on_pillars),
    "aperture_each": (OUTLINE, "not_interacting, interacting counted", aperture_each),
    "mark_keep_out": (BOX, "interacting(extents.sized)", mark_keep_out),
    "marks_complete": (BOX, "with_bbox_width, with_bbox_height", marks_complete),
    "layers_known": (NAME, "layer_infos", layers_known),
    "active_area": (BOX, "not_inside", active_area),
    "no_text_exposed": (OUTLINE, "texts", no_text_exposed),
    "cell_names": (NAME, "each_cell", cell_names),
    "depth_max": (NUMBER, "hierarchy_levels", depth_max),
    "references_max": (NUMBER, "each_inst", references_max),
    "one_top": (NAME, "top_cells", one_top),
    "dangling": (NAME, "is_ghost_cell", dangling),
    "recursive": (REFUSED, "the reader refuses the file", None),
    "cell_twice": (REFUSED, "the reader refuses the file", None),
    "shape_count": (NUMBER, "begin_shapes_rec", shape_count),
    "write_time": (NUMBER, "area, count", write_time),
}

# What KLayout cannot be asked.
INEXPRESSIBLE = {
    "closed": "its reader closes every outline",
    "winding": "its reader turns every outline one way",
    "bytes_behind_end": "its reader stops at the end of the library",
    "file_size": "no matter of shapes",
    "pillar_count": "needs the design",
    "width_map": "needs the design",
    "phase_step": "needs the design",
    "lattice_orders": "needs the design",
}
