"""The same layouts through `metalith check` and KLayout's region checks: the same shapes must be found.

usage: compare_klayout_drc.py METALITH FOLDER            (one broken layout for each rule that KLayout can express)
       compare_klayout_drc.py METALITH FOLDER --time N   (CPU seconds of both on N clean pillars, the same four rules)

Needs pip install klayout. METALITH is the program, target/release/metalith.
"""
import json
import os
import subprocess
import sys
from pathlib import Path

import klayout.db as db

PITCH, SITES = 350, 40
PILLARS, MARKS = (1, 0), (3, 0)

DECK = """schema = 1
name = "What both can express"
pillar_height_nm = 700
[layers]
pillars = "1/0"
marks = "3/0"
"""
RULES = {
    "width_min": 'nm = 100',
    "width_max": 'nm = 300',
    "square": '',
    "gap_min": 'nm = 50',
    "overlap": '',
    "grid": 'layers = ["pillars", "marks"]\nnm = 2',
    "manhattan": 'layers = ["pillars", "marks"]',
    "acute_angle": 'layers = ["marks"]\nmin_deg = 90',
    "vertices_max": 'layers = ["marks"]\ncount = 20',
    "no_text_exposed": '',
}


def deck(checks):
    rule = '\n[[rule]]\nid = "{0}"\ncheck = "{0}"\n{1}\n'
    return DECK + "".join(rule.format(c, RULES[c]) for c in checks)


def square(x, y, w):
    return db.Box(x - w // 2, y - w // 2, x + w // 2, y + w // 2)


def write(path, pillars, extra=(), texts=()):
    layout = db.Layout()
    layout.dbu = 0.001
    top = layout.create_cell("TOP")
    for x, y, w in pillars:
        top.shapes(layout.layer(*PILLARS)).insert(square(x, y, w))
    for layer, shape in extra:
        top.shapes(layout.layer(*layer)).insert(shape)
    for text in texts:
        top.shapes(layout.layer(*PILLARS)).insert(text)
    layout.write(str(path))


def dense():
    """Pillars of 200 nm, 350 nm apart."""
    return {(i, j): (PITCH * i, PITCH * j, 200) for i in range(SITES) for j in range(SITES)}


def cases():
    """Rule, layout as (pillars, further shapes, texts)."""
    def changed(key, value):
        pillars = dense()
        pillars[key] = value
        return pillars.values()

    x, y, w = dense()[(5, 7)]
    mark = db.Polygon([db.Point(*p) for p in ((0, -90000), (40000, -90000), (0, -50000))])
    octagon = db.Polygon([db.Point(1000 * a, 1000 * b - 90000)
                          for a, b in ((-20, -8), (-8, -20), (8, -20), (20, -8), (20, 8), (8, 20), (-8, 20), (-20, 8))])
    comb = db.Polygon([db.Point(0, -99000)] + [db.Point(1000 * k + 1000 * (s > 1), -98000 + 2000 * (s % 3 > 0))
                      for k in range(0, 40, 2) for s in (0, 1, 2, 3)] + [db.Point(41000, -98000), db.Point(41000, -99000)])
    yield "width_min", (changed((5, 7), (x, y, 98)), (), ())
    yield "width_max", (changed((5, 7), (x, y, 302)), (), ())
    yield "square", (dense().values(), [(PILLARS, db.Box(-5000, 0, -4800, 202))], ())
    yield "gap_min", (changed((5, 7), (x + 110, y, w)), (), ())
    yield "gap_min", (changed((5, 7), (x + 120, y + 120, w)), (), ())
    yield "gap_min", (dense().values(), [(PILLARS, db.Box(-5000, 0, -4800, 200)), (PILLARS, db.Box(-4770, 230, -4570, 430))], ())
    yield "overlap", (changed((5, 7), (x + 200, y, w)), (), ())
    yield "grid", (dense().values(), [(MARKS, db.Box(-5001, 0, -4801, 200))], ())
    yield "manhattan", (dense().values(), [(MARKS, octagon)], ())
    yield "acute_angle", (dense().values(), [(MARKS, mark)], ())
    yield "vertices_max", (dense().values(), [(MARKS, comb)], ())
    yield "no_text_exposed", (dense().values(), (), [db.Text("exposed", 1000, 2000)])


def klayout(path, rule):
    """Boxes [nm] that KLayout finds."""
    layout = db.Layout()
    layout.read(str(path))
    top = layout.top_cell()
    pillars = db.Region(top.begin_shapes_rec(layout.layer(*PILLARS)))
    marks = db.Region(top.begin_shapes_rec(layout.layer(*MARKS)))
    pillars.merged_semantics = marks.merged_semantics = False
    boxes = lambda region: [p.bbox() for p in region.each()]
    both = lambda pairs: [pair.bbox() for pair in pairs.each()]
    if rule == "width_min":
        return boxes(pillars.interacting(pillars.width_check(100).polygons()))
    if rule == "width_max":
        return boxes(pillars.with_bbox_max(301, None, False))
    if rule == "square":
        return boxes(pillars.non_squares())
    if rule == "gap_min":
        pillars.merged_semantics = True
        return both(pillars.space_check(50, False, db.Region.Euclidian))
    if rule == "overlap":
        return boxes(pillars.merged(False, 2))
    if rule == "grid":
        return both(pillars.grid_check(2, 2)) + both(marks.grid_check(2, 2))
    if rule == "manhattan":
        return boxes(pillars.non_rectilinear()) + boxes(marks.non_rectilinear())
    if rule == "acute_angle":
        return [p.bbox() for p in marks.each() if not db.Region(p).corners_dots(-179.9, -90.1).is_empty()]
    if rule == "vertices_max":
        return [p.bbox() for p in marks.each() if p.num_points() + 1 > 20]
    texts = db.Texts(top.begin_shapes_rec(layout.layer(*PILLARS)))
    return [t.bbox() for t in texts.each()]


def ours(program, path, rules, rule):
    out = subprocess.run([program, "check", path, "--rules", rules, "--json", "--markers", "100000"],
                         stdout=subprocess.PIPE, check=False)
    report = json.loads(out.stdout)
    found = next(r for r in report["rules"] if r["id"] == rule)
    assert found["status"] == "run", found
    boxes = []
    for marker in found["markers"]:
        xs, ys = zip(*marker["outline_nm"])
        boxes.append(db.Box(round(min(xs)), round(min(ys)), round(max(xs)), round(max(ys))))
    assert len(boxes) == found["violations"]
    return boxes, out.returncode


def covers(a, b):
    """Every box of a touches one of b."""
    return all(any(x.touches(y) for y in b) for x in a)


def compare(program, folder):
    wrong = 0
    for k, (rule, (pillars, extra, texts)) in enumerate(cases()):
        path, rules = folder / f"{k}_{rule}.gds", folder / f"{k}_{rule}.toml"
        write(path, pillars, extra, texts)
        rules.write_text(deck([rule]))
        theirs = klayout(path, rule)
        mine, code = ours(program, path, rules, rule)
        # Gaps and grids are edge pairs there and areas here: one place may be several of them.
        exact = rule not in ("gap_min", "grid")
        same = bool(mine) and covers(mine, theirs) and covers(theirs, mine) and code == 1
        if exact:
            same = same and sorted(map(str, mine)) == sorted(map(str, theirs))
        wrong += not same
        print(f"{rule:16} ours {len(mine)}  KLayout {len(theirs)}  {'same' if same else f'DIFFERENT: {mine[:3]} {theirs[:3]}'}")
    sys.exit(1 if wrong else 0)


def cpu(command):
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    last = process.stdout.read().strip().splitlines()[-1]
    _, status, usage = os.wait4(process.pid, 0)
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, last, os.waitstatus_to_exitcode(status)


def klayout_rules(path, deep):
    """The four rules as KLayout runs them; number of markers."""
    layout = db.Layout()
    layout.read(str(path))
    shapes = layout.top_cell().begin_shapes_rec(layout.layer(*PILLARS))
    store = db.DeepShapeStore()
    region = db.Region(shapes, store) if deep else db.Region(shapes)
    found = [region.width_check(100), region.space_check(50, False, db.Region.Euclidian), region.grid_check(1, 1),
             region.non_rectilinear()]
    print(sum(f.count() for f in found))


def time(program, folder, count):
    path, rules = folder / "clean.gds", folder / "timed.toml"
    side = round(count ** 0.5)
    made = [sys.executable, __file__, "make", path, str(side)]
    subprocess.run(made, check=True)
    rules.write_text(deck(["width_min", "gap_min", "grid", "manhattan"]).replace("nm = 2\n", "nm = 1\n"))
    seconds, memory, last, code = cpu([program, "check", path, "--rules", rules])
    print(f"{side * side} pillars: ours {seconds:.2f} CPU s {memory:.0f} MB, exit {code}: {last}")
    for mode in ("flat", "deep"):
        theirs, peak, last, _ = cpu([sys.executable, __file__, "klayout", path, mode])
        print(f"KLayout {mode} {theirs:.2f} CPU s {peak:.0f} MB, {last} markers: {theirs / seconds:.0f} x the CPU")


def main():
    if sys.argv[1] == "make":
        n = int(sys.argv[3])
        write(sys.argv[2], ((PITCH * i, PITCH * j, 200 + 2 * ((7 * i + 11 * j) % 41)) for j in range(n) for i in range(n)))
    elif sys.argv[1] == "klayout":
        klayout_rules(sys.argv[2], sys.argv[3] == "deep")
    else:
        program, folder = sys.argv[1], Path(sys.argv[2])
        folder.mkdir(parents=True, exist_ok=True)
        if "--time" in sys.argv:
            time(program, folder, int(sys.argv[sys.argv.index("--time") + 1]))
        else:
            compare(program, folder)


main()
