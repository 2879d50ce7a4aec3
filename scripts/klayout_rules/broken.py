"""For each rule of the shipped decks, layouts that break it, several times where that can be.

A function is given a clean plate and breaks it; what it returns are limits of the rule that it needs otherwise. `at` is a
place far from everything, for what is drawn besides.
"""
from .plate import LABEL, PILLARS, boundary, cell, reference, site, text

FAR = 2_000_000


def far(k):
    """Places 200 um apart."""
    return FAR, 200_000 * k


def shifted(points, k, scale=1000):
    x, y = far(k)
    return [(x + scale * a, y + scale * b) for a, b in points]


# Pillars

def narrow(p):
    p.pillars[5, 7][2], p.pillars[30, 9][2] = 98, 90
    p.box(PILLARS, 30_000, 0, 30_099, 200)


def wide(p):
    p.pillars[5, 7][2], p.pillars[30, 9][2] = 302, 340
    p.box(PILLARS, 30_000, 0, 30_200, 301)


def between_steps(p):
    p.pillars[5, 7][2], p.pillars[30, 9][2], p.pillars[20, 20][2] = 201, 251, 299
    p.pillars[8, 8][2] = 220
    return {"forbidden_nm": [220, 222]}


def tall(p):
    p.pillars[5, 7][2], p.pillars[30, 9][2], p.pillars[9, 30][2] = 92, 93, 94


def oblong(p):
    """Sides that differ by 4 and 10 nm; two steps of the grid are rounding."""
    del p.pillars[5, 5], p.pillars[7, 5]
    for i, h in ((5, 104), (7, 90)):
        p.box(PILLARS, site(i) - 100, site(5) - 100, site(i) + 100, site(5) + h)


def off_site(p):
    p.pillars[5, 5][0] += 4
    p.pillars[30, 20][1] -= 20


def off_beam(p):
    for place, width in (((5, 5), 202), ((9, 9), 206), ((20, 20), 199)):
        p.pillars[place][2] = width
    return {"beam_step_nm": 14}


# Gaps

def near_along(p):
    """Beside, above, and in the gap between two lenses, 40 nm each."""
    p.pillars[5, 7] = [site(6) - p.pillars[6, 7][2] // 2 - 40 - 100, site(7), 200]
    p.pillars[20, 20] = [site(20), site(21) - p.pillars[20, 21][2] // 2 - 40 - 60, 120]
    p.lens(60, 0, 20, 20, lambda i, j: 200)
    right, left = p.pillars[39, 12], p.pillars[60, 12]
    left[0] = right[0] + right[2] // 2 + 40 + left[2] // 2


def near_across_cells(p):
    """One cell beside itself and beside another, and a pillar of the top cell beside the reference of another."""
    p.before += [cell(name, boundary(PILLARS, [(0, 0), (w, 0), (w, w), (0, w), (0, 0)])) for name, w in (("A", 200), ("B", 180))]
    p.elements += [reference("A", *far(0)), reference("A", FAR + 245, 0), reference("B", FAR + 490, 30)]
    p.elements.append(reference("B", FAR, 1000))
    p.box(PILLARS, FAR + 10, 1000 + 180 + 49, FAR + 210, 1000 + 180 + 249)


def near_diagonally(p):
    """30 and 30 nm: 42 nm; and 34 and 36 nm: 49.5 nm. 36 and 36 nm, 50.9 nm, are far enough."""
    for k, (dx, dy) in enumerate(((30, 30), (34, 36), (36, 36), (0, 49))):
        x, y = far(k)
        p.box(PILLARS, x, y, x + 200, y + 200)
        p.box(PILLARS, x + 200 + dx, y + 200 + dy, x + 400 + dx, y + 420 + dy)


def touching(p):
    """Side by side, and corner to corner."""
    p.box(PILLARS, FAR, 0, FAR + 200, 200)
    p.box(PILLARS, FAR + 200, 0, FAR + 400, 200)
    p.box(PILLARS, FAR, 10_000, FAR + 200, 10_200)
    p.box(PILLARS, FAR + 200, 10_200, FAR + 400, 10_400)


def deep(p):
    """302 and 302 nm on neighbouring sites are 48 nm apart, 300 and 302 nm 49 nm."""
    p.pillars[5, 5][2] = p.pillars[6, 5][2] = p.pillars[20, 31][2] = 302
    p.pillars[20, 30][2] = 302
    p.pillars[30, 10][2], p.pillars[31, 10][2] = 300, 302


def sharing_area(p):
    x, y, w = p.pillars[5, 5] if p.pillars else (FAR, 0, 200)
    if not p.pillars:
        p.square(p.layer, x, y, w)
    p.square(p.layer, x + 150, y + 60, 200)
    p.square(p.layer, FAR, 40_000, 200)
    p.square(p.layer, FAR, 40_000, 120)
    # Only touching.
    p.box(p.layer, FAR, 50_000, FAR + 200, 50_200)
    p.box(p.layer, FAR + 200, 50_000, FAR + 400, 50_200)


def twice(p):
    for k in range(2):
        p.square(p.layer, FAR, 0, 200)
        p.square(p.layer, FAR, 40_000 * (k + 1), 200)
        # The same L from another corner and the other way round.
        ring = shifted([(0, 0), (9, 0), (9, 3), (3, 3), (3, 9), (0, 9)], 3, 30)
        p.polygon(p.layer, *(ring if k == 0 else ring[2::-1] + ring[:2:-1]))


def openings_near(p):
    """18 um and 19.9 um along, and 14 and 14 um diagonally; 15 and 15 um, 21.2 um, are far enough."""
    for k, (dx, dy) in enumerate(((18, 0), (0, 19.9), (14, 14), (15, 15))):
        x, y = far(k)
        dx, dy = int(1000 * dx), int(1000 * dy)
        p.box(p.layer, x, y, x + 30_000, y + 30_000)
        x, y = (x + 30_000 + dx if dx else x), (y + 30_000 + dy if dy else y)
        p.box(p.layer, x, y, x + 40_000, y + 40_000)


# Outlines, on the layer of the marks

def half_steps(p):
    """In a database of half nanometres; one square has all its corners on whole ones."""
    p.unit_nm = 0.5
    for k, (w, h) in enumerate(((400, 401), (401, 400), (400, 400))):
        x, y = far(k)
        p.box(p.marks, x, y, x + w, y + h)
    p.polygon(p.marks, *shifted([(0, 0), (400, 0), (400, 401), (200, 200)], 4, 1))


OCTAGON = [(-20, -8), (-8, -20), (8, -20), (20, -8), (20, 8), (8, 20), (-8, 20), (-20, 8)]


def slanted(p):
    p.polygon(p.marks, *shifted(OCTAGON, 0))
    p.polygon(p.layer, *shifted([(0, 0), (40, 0), (41, 40), (0, 40)], 1, 10))


def sharp(p):
    """A triangle, a right angle that is none, and a notch that is sharp from outside; an octagon is not."""
    p.polygon(p.marks, *shifted([(0, 0), (40, 0), (0, 40)], 0))
    p.polygon(p.marks, *shifted([(0, 0), (40, 0), (39, 40), (0, 40)], 1))
    p.polygon(p.marks, *shifted([(0, 0), (40, 0), (40, 40), (22, 40), (20, 10), (18, 40), (0, 40)], 2))
    p.polygon(p.marks, *shifted(OCTAGON, 3))


def crossing(p):
    """A loop, a figure of eight, and a place gone round twice; a hole with a slit and two squares that share a
    corner only touch themselves."""
    p.polygon(p.marks, *shifted([(0, 0), (30, 0), (30, 40), (40, 40), (40, 5), (0, 5)], 0))
    p.polygon(p.marks, *shifted([(0, 0), (40, 0), (0, 40), (40, 40)], 1))
    p.polygon(p.marks, *shifted([(0, 0), (9, 0), (9, 9), (0, 9), (0, 3), (6, 3), (6, 6), (0, 6)], 2))
    slit = [(0, 0), (9, 0), (9, 9), (0, 9), (0, 5), (4, 5), (4, 6), (6, 6), (6, 4), (4, 4), (4, 5), (0, 5)]
    p.polygon(p.marks, *shifted(slit, 3))
    p.polygon(p.marks, *shifted([(0, 0), (5, 0), (5, 5), (9, 5), (9, 9), (5, 9), (5, 5), (0, 5)], 4))


def doubled(p):
    p.polygon(p.marks, *shifted([(0, 0), (0, 0), (40, 0), (40, 30), (0, 30)], 0))
    p.polygon(p.layer, *shifted([(0, 0), (4, 0), (4, 3), (4, 3), (4, 3), (0, 3)], 1, 50))


def needless(p):
    p.polygon(p.marks, *shifted([(0, 0), (20, 0), (40, 0), (40, 30), (0, 30)], 0))
    p.polygon(p.layer, *shifted([(0, 0), (4, 0), (4, 1), (4, 2), (4, 4), (0, 4)], 1, 50))


def flat(p):
    """A rectangle without width, and a line forth and back."""
    p.polygon(p.marks, *shifted([(0, 0), (40, 0), (40, 0)], 0))
    p.polygon(p.layer, *shifted([(0, 0), (20, 20), (30, 30), (10, 10)], 1))


def long_outlines(p):
    """201 vertices with the closing one, and 199, which is not too many."""
    for k, teeth in enumerate((49, 48)):
        comb = [(2 * t + (s > 1), 20 * (s % 3 > 0)) for t in range(teeth) for s in range(4)]
        corners = [(2 * teeth - 1, -20), (0, -20)]
        more = [(-5, -20), (-5, -10)] if k == 0 else []
        p.polygon(p.marks, *shifted(comb + corners + more, k))


# Density and fields

def dense_windows(p):
    """Two of nine windows of 30.8 um are too full, one too empty, and one has a hole and does not count."""
    p.pillars.clear()
    full = {(0, 0): 300, (2, 1): 298, (1, 2): 74}
    p.lenses.clear()
    p.lens(0, 0, 264, 264, lambda i, j: full.get((i // 88, j // 88), 200))
    p.pillars[130, 130][2] = 100
    del p.pillars[200, 20]


def steep_windows(p):
    """Fill 0.18 between 0.47 twice in a row, and 0.33, which is not too far from either."""
    p.pillars.clear()
    p.lenses.clear()
    steps = [[240, 150, 240], [200, 200, 150], [240, 200, 240]]
    p.lens(0, 0, 264, 264, lambda i, j: steps[j // 88][i // 88])


def cut(p):
    """A boundary 30 nm beside the middle of a column, the next one a field of 7 um on; narrow pillars escape it."""
    return {"field_um": 7.0, "offset_um": [-3.5 + site(4) * 1e-3 + 0.08, 0.0]}


def bounded(p):
    p.lens(500, 0)
    p.lens(900, 0, 20, 20)
    return {"field_um": 9.0}


# Openings and marks

def tight(p):
    """Two of the three openings nearer than 1.5 um."""
    p.openings[0][2] -= 700
    p.openings[2][1] += 1200


def covered(p):
    """One opening shifted off its lens, one too small."""
    p.openings[0][0] += 3000
    p.openings[0][2] += 3000
    p.openings[2][3] -= 2400


def too_many(p):
    """Two openings over no lens, and a second one over a lens."""
    p.square(p.layer, FAR, 0, 40_000)
    p.square(p.layer, FAR, 100_000, 40_000)
    p.square(p.layer, 0, 0, 4_000)


def beside_marks(p):
    """12 um beside an arm, between the arms, and 19.9 um under one; 20 um is far enough."""
    at, half = 3_400_000, 100_000
    for x, y in ((at + half + 12_000, at), (at + 50_000, at + 50_000), (-at, at - half - 20_000), (at, -at - half - 20_200)):
        p.square(p.layer, x, y, 200)


def incomplete(p):
    """A large cross more, two small ones less, and two shapes that are no marks."""
    del p.crosses[-2:]
    p.crosses.append((*far(0), 1_000_000))
    p.box(p.marks, FAR, -2_000_000, FAR + 50_000, -1_950_000)
    p.polygon(p.marks, *shifted(OCTAGON, -8))


# Layers, cells, budgets

def strange_layers(p):
    p.box(77, 0, -100_000, 1000, -99_000)
    p.elements.append(text(78, "lost", 0, -100_000))


def outside(p):
    p.square(p.layer, 4_950_000, 0, 200)
    p.box(p.marks, -4_950_000, 0, -4_850_000, 100_000)
    p.square(p.layer, 0, 4_899_900, 200)


def exposed_text(p):
    p.elements += [text(p.layer, "exposed?", 0, -100_000), text(p.marks, "and this?", 500, -100_000)]


def bad_names(p):
    p.top = "TOP-1"
    p.before = [cell("A" * 33), cell("with blank"), cell("fine_$?")]
    p.elements += [reference(n, 0, 0) for n in ("A" * 33, "with blank", "fine_$?")]


def deep_tree(p):
    p.before.append(cell("L0", boundary(LABEL, [(0, 0), (1, 0), (1, 1), (0, 0)])))
    p.before += [cell(f"L{k}", reference(f"L{k - 1}", 0, 0)) for k in range(1, 9)]
    p.elements.append(reference("L8", 0, 0))


def many_references(p):
    p.before.append(cell("W", boundary(LABEL, [(0, 0), (1, 0), (1, 1), (0, 0)])))
    p.elements += [reference("W", 0, 10 * k) for k in range(8193)]
    return {"count": 8192}


def two_tops(p):
    p.after += [cell("LOST"), cell("FOUND")]


def nowhere(p):
    p.elements += [reference("NOWHERE", 0, 0), reference("GONE", 0, 0)]


def circle(p):
    p.before += [cell("ONE", reference("TWO", 0, 0)), cell("TWO", reference("ONE", 5, 5))]
    p.elements.append(reference("ONE", 0, 0))


def one_name(p):
    p.before.append(cell("TWICE", boundary(LABEL, [(0, 0), (1, 0), (1, 1), (0, 0)])))
    p.after.append(cell("TWICE"))
    p.elements.append(reference("TWICE", 0, 0))


def many_shapes(p):
    deep_tree(p)
    return {"count": 1000}


def slow(p):
    p.lens(500, 0)
    return {"hours": 0.00001, "field_um": 10.0}


BROKEN = {
    "pillar.width.min": [narrow],
    "pillar.width.max": [wide],
    "pillar.width.cell": [between_steps],
    "pillar.aspect": [tall],
    "pillar.square": [oblong, slanted],
    "pillar.lattice": [off_site],
    "pillar.exposure_grid": [off_beam],
    "gap.min": [near_along, near_diagonally, near_across_cells, touching],
    "gap.aspect": [deep],
    "gap.overlap": [sharing_area],
    "gap.duplicate": [twice],
    "outline.grid": [half_steps],
    "outline.manhattan": [slanted],
    "outline.acute": [sharp],
    "outline.self_crossing": [crossing],
    "outline.doubled_vertex": [doubled],
    "outline.collinear_vertex": [needless],
    "outline.zero_area": [flat],
    "outline.vertices": [long_outlines],
    "density.fill": [dense_windows],
    "density.gradient": [steep_windows],
    "field.cut": [cut],
    "field.in_lens": [bounded],
    "mark.keep_out": [beside_marks],
    "mark.complete": [incomplete],
    "layer.known": [strange_layers],
    "layer.active_area": [outside],
    "layer.text": [exposed_text],
    "cell.names": [bad_names],
    "cell.depth": [deep_tree],
    "cell.references": [many_references],
    "cell.one_top": [two_tops],
    "cell.dangling": [nowhere],
    "cell.recursive": [circle],
    "cell.twice": [one_name],
    "budget.shapes": [many_shapes],
    "budget.write_time": [slow],
    "opening.margin": [tight],
    "opening.metal_on_pillars": [covered],
    "opening.each": [too_many],
    "opening.gap": [openings_near],
    "opening.overlap": [sharing_area],
    "opening.duplicate": [twice],
}
