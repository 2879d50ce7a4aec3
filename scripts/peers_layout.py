"""Time the writing and reading of one full-size lens (6.4 million pillars) with this program and with what a
user would pick instead. Prints CPU seconds, peak memory and ratios.

usage: peers_layout.py METALITH FOLDER [gds|oasis]      needs: pip install gdstk klayout numpy
                                                and cargo build --release --example write_layout

Every tool writes the same pillars: the centre element of prototype_3x3, with a hyperbolic phase. All get them as
arrays, ready to be written, and no time counts the making of these. "copy" hands the same bytes from memory to
the same disk, through the page cache as programs do, "copy_past_cache" past it, as this program does.
"""

import json
import mmap
import os
import pathlib
import resource
import subprocess
import sys
import time

import numpy as np

PITCH, DIAMETER, FOCAL, WAVELENGTH = 350, 1_000_000, 2400.0, 0.55
DUTY = [-0.7189, 0.2686, 0.9647, -0.4873, 0.4786, 0.3501]  # of designs/prototype_3x3.toml, highest power first


def lens():
    n = 2858
    k = 2 * np.arange(n) - (n - 1)
    x, y = np.meshgrid(k, k)
    inside = (x * x + y * y) * (PITCH // 2) ** 2 <= (DIAMETER // 2) ** 2
    x, y = x[inside], y[inside]
    r2 = (x * x + y * y) * (PITCH * 0.5e-3) ** 2
    u = (-r2 / (np.sqrt(r2 + FOCAL**2) + FOCAL) / WAVELENGTH) % 1.0
    width = 2 * np.rint(PITCH / 2 * np.polyval(DUTY, u)).astype(np.int64)
    return x * (PITCH // 2), y * (PITCH // 2), width


def gdstk_library(place, corner):
    """A cell of one square a width; `place` puts it at all its centres, which are its lower left corners if `corner`."""
    from gdstk import Library, Repetition, rectangle
    x, y, w = lens()
    start = cpu()
    library = Library(unit=1e-6, precision=1e-9)
    top = library.new_cell("TOP")
    for v in np.unique(w):
        half = v // 2 if corner else 0
        at = np.stack([x[w == v] - half, y[w == v] - half], 1) * 1e-3
        place(library, top, v * 1e-3, at, Repetition(offsets=at[1:] - at[0]), rectangle)
    return library, start


def gdstk_flat(path):
    def place(_, top, width, at, repetition, rectangle):
        square = rectangle(tuple(at[0]), tuple(at[0] + width), layer=1)
        square.repetition = repetition
        top.add(square)

    library, start = gdstk_library(place, corner=True)
    library.write_gds(path)
    return cpu() - start


def gdstk_sref(path):
    from gdstk import Reference

    def place(library, top, width, at, repetition, rectangle):
        cell = library.new_cell(f"W{round(width * 1e3)}")
        cell.add(rectangle((-width / 2, -width / 2), (width / 2, width / 2), layer=1))
        reference = Reference(cell, tuple(at[0]))
        reference.repetition = repetition
        top.add(reference)

    library, start = gdstk_library(place, corner=False)
    library.write_gds(path)
    return cpu() - start


def gdstk_folded(path):
    """An eighth and the diagonal, each a cell of one square a width, placed by the symmetries of the square."""
    from gdstk import Library, Reference, Repetition, rectangle
    x, y, w = lens()
    parts = [(x > y) & (y > 0), (x == y) & (y > 0)]
    parts = [(x[part], y[part], w[part]) for part in parts]
    start = cpu()
    library = Library(unit=1e-6, precision=1e-9)
    top = library.new_cell("TOP")
    for name, mirrors, (x, y, w) in zip("AB", ((False, True), (False,)), parts):
        cell = library.new_cell(name)
        for v in np.unique(w):
            at = np.stack([x[w == v] - v // 2, y[w == v] - v // 2], 1) * 1e-3
            square = rectangle(tuple(at[0]), tuple(at[0] + v * 1e-3), layer=1)
            square.repetition = Repetition(offsets=at[1:] - at[0])
            cell.add(square)
        for mirror in mirrors:
            for turn in range(4):
                top.add(Reference(cell, (0, 0), turn * np.pi / 2, x_reflection=mirror))
    library.write_gds(path)
    return cpu() - start


def gdstk_objects(path):
    from gdstk import Library, rectangle
    x, y, w = lens()
    start = cpu()
    library = Library(unit=1e-6, precision=1e-9)
    top = library.new_cell("TOP")
    left, low, size = (x - w // 2) * 1e-3, (y - w // 2) * 1e-3, w * 1e-3
    top.add(*[rectangle((a, b), (a + c, b + c), layer=1) for a, b, c in zip(left.tolist(), low.tolist(), size.tolist())])
    library.write_gds(path)
    return cpu() - start


def klayout_filled():
    """Its database with a box for each pillar, and when that was begun."""
    import klayout.db as db
    x, y, w = lens()
    start = cpu()
    layout = db.Layout()
    layout.dbu = 0.001
    insert, box = layout.create_cell("TOP").shapes(layout.layer(1, 0)).insert, db.Box
    for a, b, h in zip(x.tolist(), y.tolist(), (w // 2).tolist()):
        insert(box(a - h, b - h, a + h, b + h))
    return layout, start


def klayout_flat(path):
    layout, start = klayout_filled()
    layout.write(path)
    return cpu() - start


def gdstk_oasis(path):
    def place(_, top, width, at, repetition, rectangle):
        square = rectangle(tuple(at[0]), tuple(at[0] + width), layer=1)
        square.repetition = repetition
        top.add(square)

    library, start = gdstk_library(place, corner=True)
    library.write_oas(path, compression_level=6)
    return cpu() - start


def klayout_oasis(path):
    """With all that its writer has to make files small; filling its database included, as a user must."""
    return klayout_write_oasis(path)[0]


def klayout_oasis_writer(path):
    """The same, its writer alone."""
    return klayout_write_oasis(path)[1]


def klayout_write_oasis(path):
    import klayout.db as db
    layout, start = klayout_filled()
    filled = cpu()
    options = db.SaveLayoutOptions()
    options.format, options.oasis_compression_level, options.oasis_write_cblocks = "OASIS", 10, True
    layout.write(path, options)
    return cpu() - start, cpu() - filled


def klayout_multiplies(path):
    """Every copy of every pillar as a box of its own, made by the program itself: nothing is done in Python."""
    import klayout.db as db
    start = cpu()
    layout = db.Layout()
    layout.read(path)
    region = db.Region(layout.top_cell().begin_shapes_rec(layout.layer(1, 0)))
    region.merged_semantics = False
    region.flatten()
    check_count(region.count())
    return cpu() - start


def gdstk_multiplies(path):
    """Every copy of every pillar as a polygon of its own."""
    from gdstk import read_gds, read_oas
    start = cpu()
    read = read_oas if path.endswith(".oas") else read_gds
    polygons = read(path).top_level()[0].get_polygons(layer=1, datatype=0)
    check_count(len(polygons))
    return cpu() - start


def klayout_reader(path):
    """KLayout's reader alone: shapes stay in its layout, nothing goes to Python."""
    import klayout.db as db
    start = cpu()
    layout = db.Layout()
    layout.read(path)
    spent = cpu() - start
    check_count(layout.top_cell().shapes(layout.layer(1, 0)).size())
    return spent


def gdstk_reader(path):
    """gdstk's reader alone."""
    from gdstk import read_gds
    start = cpu()
    library = read_gds(path)
    spent = cpu() - start
    check_count(sum(polygon.layer == 1 for polygon in library.top_level()[0].polygons))
    return spent


def gdstk_read(path):
    from gdstk import read_gds
    start = cpu()
    top = read_gds(path).top_level()[0]
    boxes = np.array([p.bounding_box() for p in top.polygons if p.layer == 1])
    check_count(len(boxes))
    return cpu() - start


def klayout_read(path):
    import klayout.db as db
    start = cpu()
    layout = db.Layout()
    layout.read(path)
    boxes = []
    for shape in layout.top_cell().each_shape(layout.layer(1, 0)):
        b = shape.bbox()
        boxes.append((b.left, b.bottom, b.width()))
    check_count(len(np.array(boxes)))
    return cpu() - start


def copy(path):
    """The same bytes, from memory to the same disk, as fast as a program can hand them over."""
    return hand_over(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)


def copy_past_cache(path):
    """The same, past the page cache."""
    return hand_over(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_DIRECT)


def hand_over(path, flags):
    size = os.path.getsize(path)
    source = mmap.mmap(-1, size + 4096)  # on whole pages
    with open(path, "rb") as file:
        file.readinto(source)
    target = str(path) + ".copy"
    start = cpu()
    out = os.open(target, flags, 0o644)
    view, step, whole = memoryview(source), 1 << 20, size - size % 4096
    for k in range(0, whole, step):
        os.write(out, view[k : min(k + step, whole)])
    os.close(out)
    with open(target, "ab", buffering=0) as end:
        end.write(view[whole:size])
        os.fsync(end.fileno())
    spent = cpu() - start
    os.remove(target)
    return spent


def check_count(found):
    if found != 6_411_448:
        sys.exit(f"read {found} pillars")


def cpu():
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def measure(command):
    """CPU seconds, wall seconds and peak memory [MB] of a command, by the operating system's account."""
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    output = process.stdout.read()
    _, status, used = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{command} failed")
    return used.ru_utime + used.ru_stime, time.perf_counter() - start, used.ru_maxrss / 1024, output


def main(program, folder, only=""):
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    designs = pathlib.Path(__file__).resolve().parent.parent / "designs"
    design = folder / "one_lens.toml"
    text = (designs / "prototype_3x3.toml").read_text()
    design.write_text(text.replace("elements = [3, 3]", "elements = [1, 1]").replace('"prototype_3x3"', '"one_lens"')
                      .replace('file = "', f'file = "{designs}/'))
    writer = pathlib.Path(program).resolve().parent / "examples" / "write_layout"

    def write(kind, path):
        _, _, memory, output = measure([writer, design, path, kind])
        seconds = json.loads(output)["cpu_s"]
        print(f"{'metalith ' + kind:44} {seconds:7.2f} {memory:7.0f}   {path.stat().st_size:,} bytes")
        return seconds

    def read(path):
        seconds, _, memory, _ = measure([program, "psf", path, "--extract-only", "--json"])
        print(f"{'metalith ' + path.name:44} {seconds:7.2f} {memory:7.0f}", flush=True)
        return seconds

    if only != "oasis":
        gds(folder, write, read)
    if only != "gds":
        oasis(folder, write, read)


def gds(folder, write, read):
    ours = {}
    print(f"{'writing one lens, 6.4 million pillars':44} {'CPU s':>7} {'MB':>7}")
    for hierarchy in ("folded", "sref", "flat"):
        path = folder / f"{hierarchy}.gds"
        ours[hierarchy] = write(hierarchy, path)
        for peer in ("copy", "copy_past_cache"):
            run_peer(peer, path, ours[hierarchy])
    for peer, against in (("gdstk_folded", "folded"), ("gdstk_flat", "flat"), ("gdstk_sref", "sref"), ("gdstk_objects", "flat"), ("klayout_flat", "flat")):
        run_peer(peer, folder / f"{peer}.gds", ours[against])
    flat = folder / "flat.gds"
    print(f"\n{'reading its flat file':44} {'CPU s':>7} {'MB':>7}")
    seconds = read(flat)
    for peer in ("gdstk_reader", "klayout_reader", "gdstk_read", "klayout_read"):
        run_peer(peer, flat, seconds)


def oasis(folder, write, read):
    print(f"\n{'writing one lens in OASIS':44} {'CPU s':>7} {'MB':>7}")
    ours = {kind: write(kind, folder / f"{kind}.oas") for kind in ("compact", "smallest")}
    for peer in ("gdstk_oasis", "klayout_oasis", "klayout_oasis_writer"):
        path = folder / f"{peer}.oas"
        run_peer(peer, path, ours["compact"])
        size = path.stat().st_size
        shares = [size / (folder / f"{kind}.oas").stat().st_size for kind in ours]
        print(f"{'':44} {size:,} bytes: {shares[0]:.2f} x ours compact, {shares[1]:.2f} x smallest")
    write("folded", folder / "folded.gds")
    # Readers that leave copies as copies have not read pillars: all are made to have each of them.
    print(f"\n{'reading every copy of every pillar':44} {'CPU s':>7} {'MB':>7}")
    for name in ("compact.oas", "smallest.oas", "klayout_oasis.oas", "folded.gds"):
        seconds = read(folder / name)
        for peer in ("klayout_multiplies", "gdstk_multiplies"):
            run_peer(peer, folder / name, seconds)


def run_peer(peer, path, ours):
    _, _, memory, output = measure([sys.executable, __file__, "--peer", peer, path])
    seconds = json.loads(output)
    print(f"{peer:44} {seconds:7.2f} {memory:7.0f}   {seconds / ours:5.1f} x ours", flush=True)


if __name__ == "__main__":
    if sys.argv[1] == "--peer":
        print(json.dumps(globals()[sys.argv[2]](sys.argv[3])))
    else:
        main(*sys.argv[1:4])
