"""Layouts converted by this program, compared in KLayout with the files that they came from: areas and texts.

usage: compare_convert.py METALITH FOLDER [FOLDER ...]
       compare_convert.py METALITH --make       (layouts of all kinds of records, by gdstk and KLayout)
needs: pip install gdstk klayout

Every GDSII, OASIS and DXF file of the folders of at most 64 MB, compressed or not, that KLayout reads is converted to
GDSII and to OASIS, and each of the two is compared with it: areas of each layer by XOR, texts by place and bytes. Exits
with 1 if anything differs, or if a file was refused without a reason of the list below. Fetches nothing.
"""
import math
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import gdstk
import klayout.db as db

# Larger files take minutes, and are passed over (bytes).
LARGEST = 64 << 20

ENDINGS = (".gds", ".gds2", ".oas", ".dxf", ".gds.gz", ".gds2.gz", ".oas.gz")

# Both turn circles and round ends into corners, each with its own number; what is thinner is rounding (database units).
THICKNESS = {".dxf": 4}
OTHERS = 2

# Words of refusals that are meant, where KLayout reads on.
MEANT = ("a second cell with the name", "which contains it", "at the top", "coordinates and sizes up to 2147483647", "no cell in the file")


UNITS_UM = {1: 25400, 2: 304800, 4: 1e3, 5: 1e4, 6: 1e6, 8: 0.0254, 9: 25.4, 11: 1e-4, 12: 1e-3, 14: 1e5}  # of $INSUNITS


def options_of(path):
    """How KLayout is to read a drawing: in the unit that it states, closed polylines as polygons, circles to half a nanometre."""
    options = db.LoadLayoutOptions()
    if path.name.endswith(".dxf"):
        stated = re.search(rb"\$INSUNITS\s+70\s+(\d+)", path.read_bytes())
        options.dxf_unit = UNITS_UM.get(int(stated[1]) if stated else 0, 1)
        options.dxf_polyline_mode, options.dxf_circle_accuracy = 2, 0.0005 / options.dxf_unit
    return options


def layout(path):
    found = db.Layout()
    devnull, kept = os.open(os.devnull, os.O_WRONLY), os.dup(2)
    os.dup2(devnull, 2)  # its warnings
    try:
        found.read(str(path), options_of(path))
    finally:
        os.dup2(kept, 2)
        os.close(devnull)
        os.close(kept)
    return found


def content(found):
    """Merged areas and sorted texts of each layer, in nanometres."""
    areas, texts = {}, {}
    for index in found.layer_indexes():
        info = found.get_info(index)
        key = (info.layer, info.datatype)
        region = areas.setdefault(key, db.Region())
        words = texts.setdefault(key, [])
        for top in found.top_cells():
            if top.name.startswith("$$$"):
                continue
            region.insert(top.begin_shapes_rec(index))
            each = top.begin_shapes_rec(index)
            each.shape_flags = db.Shapes.STexts
            while not each.at_end():
                at = each.trans() * each.shape().text_pos
                words.append((round(at.x), round(at.y), each.shape().text_string))
                each.next()
    areas = {key: region.merged() for key, region in areas.items() if not region.is_empty()}
    return areas, {key: sorted(words) for key, words in texts.items() if words}


def differences(first, second, thickness):
    (areas, texts), (other_areas, other_texts) = first, second
    out = []
    for key in sorted(set(areas) | set(other_areas)):
        apart = areas.get(key, db.Region()) ^ other_areas.get(key, db.Region())
        if not apart.sized(-thickness / 2).is_empty():
            out.append(f"{key}: {apart.area()} of {areas.get(key, db.Region()).area()} nm2")
    for key in sorted(set(texts) | set(other_texts)):
        if texts.get(key) != other_texts.get(key):
            out.append(f"texts of {key}: {len(texts.get(key, []))} and {len(other_texts.get(key, []))}")
    return out


def compare(program, path, folder):
    """"same", or what differs, or why it was refused; None if KLayout does not read the file."""
    try:
        original = layout(path)
    except RuntimeError:
        return None
    first = None
    for ending in ("gds", "oas"):
        out = folder / f"converted.{ending}"
        out.unlink(missing_ok=True)
        run = subprocess.run([program, "convert", "--quiet", str(path), str(out)], capture_output=True, text=True)
        if run.returncode != 0:
            return "refused: " + (run.stderr.strip() or f"exit {run.returncode}").splitlines()[-2 if "help:" in run.stderr else -1]
        first = first or content(original)
        converted = layout(out)
        if abs(converted.dbu - original.dbu) > 1e-9:
            # Areas of both in the units of the original.
            converted.transform(db.DCplxTrans(converted.dbu / original.dbu))
        thickness = next((t for end, t in THICKNESS.items() if path.name.endswith(end)), OTHERS)
        found = differences(first, content(converted), thickness)
        if found:
            return f"differs in {ending}: " + "; ".join(found[:4])
    return "same"


def files_of(folders):
    for folder in folders:
        yield from sorted(p for p in Path(folder).rglob("*") if p.name.lower().endswith(ENDINGS) and p.is_file() and p.stat().st_size <= LARGEST)


def run(program, folders):
    counts, failed = {"same": 0, "refused as meant": 0, "not read by KLayout": 0}, 0
    with tempfile.TemporaryDirectory() as scratch:
        for path in files_of(folders):
            found = compare(program, path, Path(scratch))
            if found is None:
                counts["not read by KLayout"] += 1
            elif found == "same":
                counts["same"] += 1
            elif found.startswith("refused") and any(words in found for words in MEANT):
                counts["refused as meant"] += 1
            else:
                failed += 1
                print(f"{path}: {found}")
    print(", ".join(f"{count} {what}" for what, count in counts.items()) + f", {failed} differ or were refused")
    return 1 if failed or counts["same"] == 0 else 0


# Layouts of all kinds of records.

CORNERS = [(0, 0), (4, 0), (4, 1), (1.5, 1), (1.5, 3), (0, 3)]
LINE = [(0, 0), (3, 0), (3, 2), (7, 4)]


def gdstk_library(fill):
    library = gdstk.Library("MADE", 1e-6, 1e-9)
    top, part = library.new_cell("TOP"), library.new_cell("PART")
    part.add(gdstk.Polygon(CORNERS, layer=1), gdstk.rectangle((5, 5), (5.3, 5.2), layer=1, datatype=3))
    fill(top, part)
    if not top.references:
        top.add(gdstk.Reference(part, (20, 0)))
    return library


def gdstk_kinds():
    def path(ends):
        def fill(top, _):
            top.add(gdstk.FlexPath(LINE, 0.4, simple_path=True, layer=2, ends=ends))
            top.add(gdstk.FlexPath([(0, 9), (0, 9.7)], 0.2, simple_path=True, layer=2, ends=ends))
        return fill

    def placed(**how):
        return lambda top, part: top.add(gdstk.Reference(part, (7, -3), **how))

    def repeated(repetition):
        def fill(top, _):
            square = gdstk.rectangle((0, 0), (0.2, 0.2), layer=5)
            square.repetition = repetition
            top.add(square)
        return fill

    def texts(top, _):
        for k, (turn, size) in enumerate(((0, 1), (0.3, 2), (math.pi / 2, 0.5))):
            top.add(gdstk.Label(f"text {k}", (k, 2 * k), rotation=turn, magnification=size, layer=9, texttype=k))

    def properties(top, _):
        square = gdstk.rectangle((0, 0), (1, 1), layer=6)
        square.set_property("NAME", [1, -2, 0.5, b"bytes"])
        square.set_gds_property(3, "value")
        top.add(square)

    def circles(top, _):
        top.add(gdstk.ellipse((0, 0), 1.5, tolerance=1e-3, layer=7), gdstk.ellipse((9, 0), (2, 1), tolerance=1e-3, layer=7))

    def large(top, _):
        top.add(gdstk.ellipse((0, 0), 400, tolerance=1e-5, layer=7))

    def trapezoids(top, _):
        for k, right in enumerate((3, 4, 5, 2)):
            top.add(gdstk.Polygon([(6 * k, 0), (6 * k + 4, 0), (6 * k + right, 1), (6 * k + 1, 1)], layer=8))
            top.add(gdstk.Polygon([(0, 6 * k), (1, 6 * k + 1), (1, 6 * k + right), (0, 6 * k + 4)], layer=8, datatype=1))

    def robust(top, _):
        top.add(gdstk.RobustPath((0, 0), 0.5, simple_path=True, layer=2).segment((5, 0)).arc(2, -math.pi / 2, 0))

    kinds = {f"path_{ends if isinstance(ends, str) else 'own'}": path(ends) for ends in ("flush", "extended", "round", (0.1, 0.3))}
    kinds |= {
        "turned": placed(rotation=math.pi / 2), "mirrored": placed(x_reflection=True), "magnified": placed(magnification=2.5),
        "any_angle": placed(rotation=0.4, magnification=0.7, x_reflection=True),
        "array": placed(columns=3, rows=2, spacing=(6, 5)),
        "array_turned": placed(columns=3, rows=2, spacing=(6, 5), rotation=math.pi, magnification=2),
        "array_any_angle": placed(columns=3, rows=2, spacing=(6, 5), rotation=0.3),
        "repeated_grid": repeated(gdstk.Repetition(3, 4, spacing=(1, 2))),
        "repeated_skew": repeated(gdstk.Repetition(3, 4, v1=(1, 0.5), v2=(-0.3, 2))),
        "repeated_x": repeated(gdstk.Repetition(x_offsets=[1, 2.5, 7])),
        "repeated_y": repeated(gdstk.Repetition(y_offsets=[1, 2.5, 7])),
        "repeated_anywhere": repeated(gdstk.Repetition(offsets=[(1, 0.3), (-4, 2.2), (0.001, 7)])),
        "texts": texts, "properties": properties, "circles": circles, "large_outline": large, "trapezoids": trapezoids,
        "robust_path": robust,
    }
    return kinds


def make(folder):
    folder = Path(folder)
    for name, fill in gdstk_kinds().items():
        gdstk_library(fill).write_gds(folder / f"gdstk_{name}.gds")
        level = 9 if "repeated" in name or "array" in name else 0
        gdstk_library(fill).write_oas(folder / f"gdstk_{name}.oas", compression_level=level, detect_rectangles=True, detect_trapezoids=True)
    # The same by KLayout, which has other records for the same shapes.
    for path in sorted(folder.glob("gdstk_*.oas")):
        found = layout(path)
        options = db.SaveLayoutOptions()
        options.format, options.oasis_compression_level, options.oasis_write_cblocks = "OASIS", 2, True
        found.write(str(folder / path.name.replace("gdstk", "klayout")), options)
        options = db.SaveLayoutOptions()
        options.format, options.gds2_multi_xy_records, options.gds2_write_timestamps = "GDS2", True, False
        found.write(str(folder / path.name.replace("gdstk", "klayout").replace(".oas", ".gds.gz")), options)
        options = db.SaveLayoutOptions()
        options.format = "DXF"
        found.write(str(folder / path.name.replace("gdstk", "klayout").replace(".oas", ".dxf")), options)


def main():
    program, *folders = sys.argv[1:]
    if folders == ["--make"]:
        with tempfile.TemporaryDirectory() as folder:
            make(folder)
            return run(program, [folder])
    return run(program, folders)


if __name__ == "__main__":
    sys.exit(main())
