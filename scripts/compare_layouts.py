"""Hold the layouts of this program to KLayout and gdstk, which share no code with it.

usage: compare_layouts.py METALITH FOLDER

Writes the three hierarchies of mini_3x3 and of one full-size lens, XORs them with KLayout to nothing, counts
their pillars with KLayout and (the small one) with gdstk, and looks at the aperture file. Exit code 1 on the first difference.
"""

import pathlib
import subprocess
import sys

import gdstk
import klayout.db as db

HIERARCHIES = ("flat", "folded", "sref")
PILLARS, APERTURES = (1, 0), (2, 0)
# Counted once by brute force over the lattice: sites whose centre is inside the circle.
COUNTS = {"mini_3x3": 9 * 23092, "one_lens": 6_411_448}
OLD_READERS_TAKE = 200


def main(program, folder):
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
        compare(name, files)
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
    # Layouts stay referenced: a region does not outlive its layout.
    flat_layout, flat = pillars(files["flat"])
    expect(f"{name} flat: pillars", flat.count(), COUNTS[name])
    for hierarchy in HIERARCHIES[1:]:
        layout, region = pillars(files[hierarchy])
        expect(f"{name} {hierarchy}: pillars", region.count(), COUNTS[name])
        expect(f"{name} {hierarchy}: polygons of the XOR with flat", (flat ^ region).count(), 0)


def count_with_gdstk(name, files):
    for hierarchy, path in files.items():
        top = gdstk.read_gds(str(path)).top_level()[0]
        polygons = top.get_polygons(layer=PILLARS[0], datatype=PILLARS[1])
        expect(f"{name} {hierarchy}: pillars in gdstk", len(polygons), COUNTS[name])


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
    main(sys.argv[1], sys.argv[2])
