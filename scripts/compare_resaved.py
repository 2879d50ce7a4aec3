"""Layouts of designs as other programs save them again: the same numbers, rules, pillars and PSFs as the layout itself.

Each layout is saved by KLayout as GDSII with notes on its cells and as OASIS, by gdstk, and as a component: below a top
cell of another name, as gdsfactory places a lens. `info` is compared with KLayout's own counts and boxes; `diff`,
`check`, `verify` and `psf` must say the same of every file. With `--session`, the layout of a measured set is saved in
the same ways, and `calibrate` must say the same of each.

usage: python scripts/compare_resaved.py METALITH OUT [--session FOLDER] DESIGN...
needs: pip install klayout gdstk
"""
import argparse
import json
import shutil
import subprocess
import sys
from pathlib import Path

import gdstk
import klayout.db as db

# Differences that are no fault: which file it was, and what depends on how it is nested.
PLACES = {"layout", "path", "file", "top", "bytes", "offset", "design", "out", "seconds", "digest", "hash"}


def run(program, *arguments, codes=(0,)):
    done = subprocess.run([program, *map(str, arguments), "--quiet"], capture_output=True, text=True)
    if done.returncode not in codes:
        sys.exit(f"{' '.join(map(str, arguments))}: exit code {done.returncode}\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done


def klayout(path):
    layout = db.Layout()
    layout.read(str(path))
    return layout


def save_again(path, folder):
    """The layout as others save it, by name."""
    layout = klayout(path)
    options = db.SaveLayoutOptions()
    files = {}
    for cell in layout.each_cell():
        cell.add_meta_info(db.LayoutMetaInfo("note", f"of {cell.name}", "a note", True))
    options.write_context_info = True
    files["klayout_gds"] = folder / "klayout.gds"
    options.format = "GDS2"
    layout.write(str(files["klayout_gds"]), options)
    options.write_context_info = False
    files["klayout_oasis"] = folder / "klayout.oas"
    options.format = "OASIS"
    options.oasis_compression_level = 10
    layout.write(str(files["klayout_oasis"]), options)
    library = gdstk.read_gds(str(path))
    files["gdstk"] = folder / "gdstk.gds"
    library.write_gds(str(files["gdstk"]), max_points=8190)
    (top,) = library.top_level()
    chip = library.new_cell("CHIP")
    chip.add(gdstk.Reference(top, (0, 0)))
    files["component"] = folder / "component.gds"
    library.write_gds(str(files["component"]), max_points=8190)
    return files


def counts(layout):
    """Shapes, texts and box of each layer by KLayout, arrays multiplied, nothing expanded."""
    copies = {}
    for cell in (layout.cell(index) for index in layout.each_cell_top_down()):
        copies.setdefault(cell.cell_index(), 1 if cell.is_top() else 0)
        for instance in cell.each_inst():
            child = instance.cell_index
            copies[child] = copies.get(child, 0) + copies[cell.cell_index()] * instance.size()
    found = {}
    for info, index in ((layout.get_info(index), index) for index in layout.layer_indexes()):
        shapes = texts = 0
        box = db.DBox()
        for cell in layout.each_cell():
            if cell.name.startswith("$$$"):
                continue
            own = cell.shapes(index)
            text = sum(1 for _ in own.each(db.Shapes.STexts))
            texts += copies[cell.cell_index()] * text
            shapes += copies[cell.cell_index()] * (own.size() - text)
        for top in layout.top_cells():
            # Texts have a place, and are in KLayout's box of a layer.
            if shapes:
                region = db.Region(top.begin_shapes_rec(index)) if texts else None
                around = region.bbox() if region else top.bbox(index)
                box += around.to_dtype(layout.dbu * 1e3)
        if shapes or texts:
            bounds = [round(v, 3) for v in (box.left, box.bottom, box.right, box.top)] if shapes else None
            found[f"{info.layer}/{info.datatype}"] = (shapes, texts, bounds)
    return found


def info(program, path):
    found = json.loads(run(program, "info", path, "--json").stdout)
    layers = {}
    for layer in found["layers"]:
        bounds = layer["bounds_nm"]
        number = f"{layer['layer']['layer']}/{layer['layer']['datatype']}"
        layers[number] = (layer["shapes"], layer["texts"], bounds and [round(v, 3) for v in bounds])
    return found, layers


def without_places(value):
    if isinstance(value, dict):
        return {k: without_places(v) for k, v in value.items() if k not in PLACES}
    return [without_places(v) for v in value] if isinstance(value, list) else value


def same(what, own, other, path):
    own, other = without_places(own), without_places(other)
    if own == other:
        return
    keys = [k for k in own if own[k] != other.get(k)] if isinstance(own, dict) else []
    details = "".join(f"\n  {k}: {str(own[k])[:300]}\n  {k}: {str(other.get(k))[:300]}" for k in keys)
    sys.exit(f"{path}: `{what}` says something else{details}")


def rules(program, layout, design):
    done = run(program, "check", layout, "--design", design, "--json", codes=(0, 1, 3))
    found = json.loads(done.stdout)
    kept = [(r["id"], r["status"], r["violations"]) for r in found["rules"]]
    return {"code": done.returncode, "rules": [rule for rule in kept if not rule[0].startswith(("cell.", "budget."))]}


def judged(program, layout, design, folder):
    shutil.rmtree(folder, ignore_errors=True)
    done = run(program, "verify", design, layout, "--fast", "--fidelity", "published", "--out", folder, codes=(0, 1))
    report = json.loads((folder / "report.json").read_text())
    return {"code": done.returncode} | report


def psf(program, layout, design, quick):
    arguments = ["psf", layout, "--samples", 32, "--fast", "--json"]
    arguments += ["--cell", design, "--fidelity", "rigorous"] if not quick else ["--fidelity", "published"]
    done = run(program, *arguments, codes=(0, 1))
    return {"code": done.returncode} | json.loads(done.stdout)


def compare(program, design, out):
    folder = out / design.stem
    folder.mkdir(parents=True, exist_ok=True)
    written = run(program, "layout", design, "--out", folder).stdout
    layout = folder / f"{design.stem}_pillars.gds"
    assert layout.exists(), written
    published = "pillar_height_nm = 700" in design.read_text() and "shape =" not in design.read_text()
    files = save_again(layout, folder)
    own, layers = info(program, layout)
    same("info", layers, counts(klayout(layout)), layout)
    first = rules(program, layout, design)
    report = judged(program, layout, design, folder / "own") if published else None
    light = psf(program, layout, design, published)
    for name, path in files.items():
        again, same_layers = info(program, path)
        same("info", layers, same_layers, path)
        same("info: lattices", [e["elements"] for e in own["lattices"]], [e["elements"] for e in again["lattices"]], path)
        run(program, "diff", layout, path)
        same("check", first, rules(program, path, design), path)
        if report:
            same("verify", report, judged(program, path, design, folder / name), path)
        same("psf", light, psf(program, path, design, published), path)
    shapes = sum(layer[0] for layer in layers.values())
    print(f"{design.stem}: {shapes} shapes, the same in {len(files)} files saved again", flush=True)


def calibrate(program, session, out):
    """The diagnosis of a measured set whose layout was saved again."""
    text = (session / "measurement.toml").read_text()
    (name,) = [line.split('"')[1] for line in text.splitlines() if line.startswith("layout")]
    work = out / "session"
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    original = work / "original.gds"
    run(program, "convert", session / name, original)
    found = {}
    for key, path in {"original": session / name, **save_again(original, work)}.items():
        copy = work / key
        shutil.copytree(session, copy)
        target = copy / path.name
        if path != session / name:
            shutil.copy(path, target)
        (copy / "measurement.toml").write_text(text.replace(f'"{name}"', f'"{target.name}"'))
        done = run(program, "calibrate", copy, "--json", "--effects", "defocus", "--out", copy / "out", codes=(0, 1))
        found[key] = json.loads(done.stdout)
        same("calibrate", found["original"], found[key], path)
    print(f"{session.name}: the same diagnosis of {len(found) - 1} layouts saved again", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("out", type=Path)
    parser.add_argument("--session", type=Path)
    parser.add_argument("designs", type=Path, nargs="+")
    args = parser.parse_args()
    for design in args.designs:
        compare(args.program, design, args.out)
    if args.session:
        calibrate(args.program, args.session, args.out)


if __name__ == "__main__":
    main()
