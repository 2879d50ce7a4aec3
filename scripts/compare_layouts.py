"""Hold the layouts of this program to KLayout and gdstk, which share no code with it.

usage: compare_layouts.py METALITH FOLDER [--times]

Writes the three hierarchies of mini_3x3 and of one full-size lens, and their three encodings in OASIS, XORs them with
KLayout to nothing, counts their pillars with KLayout and (the small one) with gdstk, and looks at the aperture file.
OASIS files are validated by gdstk, and read by KLayout in strict mode with all its warnings, of which there must be
none. With --times, sizes and CPU seconds of OASIS are printed beside those of KLayout's writer and of both readers. Exit
code 1 on the first difference.
"""

import concurrent.futures
import os
import pathlib
import subprocess
import sys

import gdstk
import klayout.db as db

from cpu_time import children

HIERARCHIES = ("flat", "folded", "sref")
ENCODINGS = ("compact", "plain", "smallest")
PILLARS, APERTURES = (1, 0), (2, 0)
# Counted once by brute force over the lattice: sites whose centre is inside the circle.
COUNTS = {"mini_3x3": 9 * 23092, "one_lens": 6_411_448}
OLD_READERS_TAKE = 200


def main(program, folder, *options):
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    designs = pathlib.Path(__file__).parent.parent / "designs"
    one_lens = folder / "one_lens.toml"
    text = (designs / "prototype_3x3.toml").read_text()
    one_lens.write_text(text.replace("elements = [3, 3]", "elements = [1, 1]").replace('"prototype_3x3"', '"one_lens"')
                        .replace('file = "', f'file = "{designs.resolve()}/'))
    for design in (designs / "mini_3x3.toml", one_lens):
        name = design.stem
        files = {}
        for hierarchy in HIERARCHIES:
            out = folder / name / hierarchy
            subprocess.run([program, "layout", design, "--hierarchy", hierarchy, "--out", out, "--quiet"], check=True,
                           stdout=subprocess.DEVNULL)
            files[hierarchy] = out / f"{name}_pillars.gds"
        for encoding in ENCODINGS:
            out = folder / name / encoding
            subprocess.run([program, "layout", design, "--oasis", encoding, "--out", out, "--quiet"], check=True,
                           stdout=subprocess.DEVNULL)
            files[encoding] = out / f"{name}_pillars.oas"
            look_at_oasis(f"{name} {encoding}", files[encoding])
            subprocess.run([program, "diff", files["folded"], files[encoding], "--quiet"],
                           check=encoding != "plain", stdout=subprocess.DEVNULL)
        back = folder / name / "back.gds"
        subprocess.run([program, "convert", files["compact"], back, "--quiet"], check=True, stdout=subprocess.DEVNULL)
        files["converted"] = back
        # An XOR of a full lens takes KLayout minutes; of the encodings it sees the default, `diff` saw the others.
        compared = files if name == "mini_3x3" else {h: files[h] for h in (*HIERARCHIES, "compact")}
        compare(name, compared)
        if "--times" in options:
            time_oasis(name, program, files, folder)
        if name == "mini_3x3":
            count_with_gdstk(name, files)
        look_at_apertures(files["flat"].with_name(f"{name}_apertures.gds"))
    print("all layouts agree")


def pillars(path):
    layout = db.Layout()
    layout.read(str(path))
    region = db.Region(layout.top_cell().begin_shapes_rec(layout.layer(*PILLARS)))
    region.merged_semantics = False
    return layout, region


def compare(name, files):
    """Compare with the flat layout, each other one in a process: an XOR uses one core."""
    # The layout stays referenced: a region does not outlive it.
    flat_layout, flat = pillars(files["flat"])
    expect(f"{name} flat: pillars", flat.count(), COUNTS[name])
    others = [h for h in files if h != "flat"]
    with concurrent.futures.ProcessPoolExecutor(os.cpu_count()) as pool:
        found = pool.map(difference, [files["flat"]] * len(others), [files[h] for h in others])
        for hierarchy, (count, polygons) in zip(others, found):
            expect(f"{name} {hierarchy}: pillars", count, COUNTS[name])
            expect(f"{name} {hierarchy}: polygons of the XOR with flat", polygons, 0)


def difference(flat_path, path):
    """Pillars of a layout, and polygons by which it differs from the flat one."""
    flat_layout, flat = pillars(flat_path)
    layout, region = pillars(path)
    return region.count(), (flat ^ region).count()


def count_with_gdstk(name, files):
    for hierarchy, path in files.items():
        read = gdstk.read_oas if path.suffix == ".oas" else gdstk.read_gds
        top = read(str(path)).top_level()[0]
        polygons = top.get_polygons(layer=PILLARS[0], datatype=PILLARS[1])
        expect(f"{name} {hierarchy}: pillars in gdstk", len(polygons), COUNTS[name])


def look_at_oasis(what, path):
    """Validation by gdstk, and no word of KLayout in strict mode."""
    expect(f"{what}: checksum in gdstk", gdstk.oas_validate(str(path))[0], True)
    said = run(f"""
        options = db.LoadLayoutOptions()
        options.warn_level, options.oasis_expect_strict_mode = 3, 1
        db.Layout().read({str(path)!r}, options)""")[1]
    expect(f"{what}: warnings of KLayout", said, "")


def run(code):
    """CPU seconds of a piece of Python in a process of its own, and what it said."""
    lines = "\n".join(line.strip() for line in code.strip().splitlines())
    return timed([sys.executable, "-c", f"import gdstk\nimport klayout.db as db\n{lines}"])


def timed(command):
    before = children()
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    return children() - before, done.stdout.strip()


def time_oasis(name, program, files, folder):
    """Sizes and CPU seconds, less what an empty process takes."""
    own, theirs, empty = folder / name / "own.oas", folder / name / "klayout.oas", run("")[0]
    ours = timed([program, "convert", files["folded"], own, "--quiet"])[0]
    seconds = run(f"""
        layout = db.Layout()
        layout.read({str(files["folded"])!r})
        layout.write({str(theirs)!r})""")[0] - empty
    print(f"{name}: KLayout reads GDSII and writes OASIS: {theirs.stat().st_size} bytes, {seconds:.2f} CPU s; "
          f"metalith convert: {own.stat().st_size} bytes, {ours:.2f} CPU s")
    for encoding in ENCODINGS:
        path = str(files[encoding])
        klayout = run(f"db.Layout().read({path!r})")[0] - empty
        theirs = run(f"gdstk.read_oas({path!r})")[0] - empty
        print(f"{name} {encoding}: {files[encoding].stat().st_size} bytes; "
              f"read by KLayout in {klayout:.2f}, by gdstk in {theirs:.2f} CPU s")


def look_at_apertures(path):
    layout = db.Layout()
    layout.read(str(path))
    expect(f"{path.name}: cells", layout.cells(), 1)
    for shape in layout.top_cell().shapes(layout.layer(*APERTURES)).each():
        points = [(p.x, p.y) for p in shape.polygon.each_point_hull()]
        expect(f"{path.name}: vertices allowed", len(points) + 1 <= OLD_READERS_TAKE, True)
        expect(f"{path.name}: doubled vertices", len(points) - len(set(points)), 0)


def expect(what, found, wanted):
    if found != wanted:
        sys.exit(f"{what}: {found}, expected {wanted}")
    print(f"{what}: {found}")


if __name__ == "__main__":
    main(*sys.argv[1:])
