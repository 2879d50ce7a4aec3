"""The same layouts through `metalith check` and KLayout's region checks: the same shapes must be found.

usage: compare_klayout_drc.py METALITH FOLDER            (every rule of the decks `sin_pillars` and `sin_apertures`, with the table of docs/method/check.md)
       compare_klayout_drc.py METALITH FOLDER --time N   (CPU seconds of both on N clean pillars, the same four rules)

Needs pip install klayout. METALITH is the program, target/release/metalith.
"""
import json
import os
import re
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

import klayout.db as db

from klayout_rules import broken, expressions as ask
from klayout_rules.plate import PILLARS, Plate, clean_openings, clean_pillars

DECKS = ["sin_pillars", "sin_apertures"]
RULES = Path(__file__).parent.parent / "rules"


def toml(deck, rules):
    """The head of a shipped deck, and rules of it."""
    head = [f"{key} = {json.dumps(deck[key])}" for key in ("schema", "name", "pillar_height_nm")]
    sections = [("[layers]", deck["layers"])] + [("[[rule]]", rule) for rule in rules]
    lines = ["\n".join([name] + [f"{k} = {json.dumps(v)}" for k, v in keys.items()]) for name, keys in sections]
    return "\n\n".join(["\n".join(head)] + lines) + "\n"


def ours(program, path, rules, with_):
    command = [program, "check", path, "--rules", rules, "--json", "--markers", "100000"]
    out = subprocess.run(command + (["--with", with_] if with_ else []), stdout=subprocess.PIPE, check=False)
    # What is no pillar is reported beside the rules of any deck.
    found = next(rule for rule in json.loads(out.stdout)["rules"] if rule["id"] != "element.recognised")
    assert found["status"] == "run", found
    assert len(found["markers"]) == found["violations"], found
    return found, out.returncode


def name_in(words):
    """What a finding without a place is about."""
    patterns = r"layer (\S+) with", r'cell "(.*)" of', r"refers to (\S+), which", r"(\d+ marks of \S+ um)", r"top cells in \S+: (.*)"
    return next(m[1] for m in (re.match(".*?" + p, words) for p in patterns) if m)


def finding(view, kind, shapes, marker):
    """A marker of ours in the form that it is compared in."""
    outline = [tuple(round(v / view.unit_nm) for v in p) for p in marker["outline_nm"]]
    if not outline:
        return name_in(marker["words"])
    box = db.Polygon([db.Point(*p) for p in outline], True).bbox()
    if kind == ask.LENS:
        return view.lens_of(box)
    if kind == ask.PAIR:
        return view.neighbours(shapes, box)
    return ask.boxes([db.Polygon(box)])[0] if kind == ask.BOX else ask.ring(outline)


def same(rule, found, path, deck, lenses, with_):
    """Whether both find the same; numbers of findings of both."""
    kind, _, find = ask.EXPRESSIONS[rule["check"]]
    try:
        view = ask.View(path, deck, lenses, with_)
    except RuntimeError:
        return kind == ask.REFUSED and found["violations"] > 0, found["violations"], "refused"
    if kind == ask.REFUSED:
        return False, found["violations"], "read"
    theirs = find(view, rule)
    if kind == ask.NUMBER:
        value = [v for k, v in found["facts"].items() if "[" not in k][0]
        return len(found["markers"]) == 1 and abs(value - theirs[0]) < 1e-9 * value, f"{value:.6g}", f"{theirs[0]:.6g}"
    shapes = view.shapes(rule) if kind == ask.PAIR else None
    mine = [finding(view, kind, shapes, m) for m in found["markers"]]
    if kind == ask.NAME:
        mine = [n for names in mine for n in names.split(", ")]
    differ = (Counter(mine) - Counter(theirs)) + (Counter(theirs) - Counter(mine))
    if differ:
        print(f"{rule['id']}: only one of both has {list(differ)[:4]}")
    return bool(mine) and not differ, len(mine), len(theirs)


def compare(program, folder):
    wrong, asked = 0, set()
    print(f"{'rule':26} {'KLayout':42} {'compared by':12} ours / KLayout")
    for name in DECKS:
        deck = tomllib.loads((RULES / f"{name}.toml").read_text())
        for rule in deck["rule"]:
            if rule["check"] in ask.INEXPRESSIBLE:
                print(f"{rule['id']:26} none: {ask.INEXPRESSIBLE[rule['check']]}")
                continue
            for k, breaks in enumerate(broken.BROKEN[rule["id"]]):
                path = folder / f"{name}_{rule['id']}_{k}.gds"
                with_, plate = None, clean_pillars()
                if name == "sin_apertures":
                    below = clean_pillars(lenses=3)
                    with_, plate = folder / "pillars.gds", clean_openings(below.lenses)
                    below.write(with_)
                rule_here = {**rule, "severity": "error", **(breaks(plate) or {})}
                plate.write(path)
                path.with_suffix(".toml").write_text(toml(deck, [rule_here]))
                found, code = ours(program, path, path.with_suffix(".toml"), with_)
                alike, mine, theirs = same(rule_here, found, path, deck, plate.lenses, with_)
                alike = alike and code == 1
                wrong += not alike
                kind, words, _ = ask.EXPRESSIONS[rule["check"]]
                print(f"{rule['id']:26} {words:42} {kind:12} {mine} / {theirs}  {'same' if alike else 'DIFFERENT'}")
            asked.add(rule["id"])
    assert asked == set(broken.BROKEN), "a layout for a rule that no deck has"
    sys.exit(1 if wrong else 0)


def cpu(command):
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    last = process.stdout.read().strip().splitlines()[-1]
    _, status, usage = os.wait4(process.pid, 0)
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, last, os.waitstatus_to_exitcode(status)


def klayout_rules(path, deep):
    """Four rules as KLayout runs them unless told otherwise; number of markers."""
    layout = db.Layout()
    layout.read(str(path))
    shapes = layout.top_cell().begin_shapes_rec(layout.layer(PILLARS, 0))
    store = db.DeepShapeStore()
    region = db.Region(shapes, store) if deep else db.Region(shapes)
    found = [region.width_check(100), region.space_check(50, False, db.Region.Euclidian), region.grid_check(1, 1),
             region.non_rectilinear()]
    print(sum(f.count() for f in found))


def time(program, folder, count):
    """Width, gap, grid and angles of a square of clean pillars, ours and KLayout's, each a process of its own."""
    path, rules = folder / "clean.gds", folder / "timed.toml"
    side = round(count ** 0.5)
    subprocess.run([sys.executable, __file__, "make", path, str(side)], check=True)
    deck = tomllib.loads((RULES / "sin_pillars.toml").read_text())
    four = [r for r in deck["rule"] if r["check"] in ("width_min", "gap_min", "grid", "manhattan")]
    rules.write_text(toml(deck, four))
    seconds, memory, last, code = cpu([program, "check", path, "--rules", rules])
    print(f"{side * side} pillars: ours {seconds:.2f} CPU s {memory:.0f} MB, exit {code}: {last}")
    for mode in ("flat", "deep"):
        theirs, peak, last, _ = cpu([sys.executable, __file__, "klayout", path, mode])
        print(f"KLayout {mode} {theirs:.2f} CPU s {peak:.0f} MB, {last} markers: {theirs / seconds:.0f} x the CPU")


def main():
    if sys.argv[1] == "make":
        plate, n = Plate(PILLARS, None), int(sys.argv[3])
        plate.lens(0, 0, n, n)
        plate.write(Path(sys.argv[2]))
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
