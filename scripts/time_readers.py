"""CPU seconds and peak memory of reading pillars back: ours, gdstk, KLayout, on the same files in one go.

usage: time_readers.py [PILLARS] [FOLDER]     (default 5,000,000 and a temporary folder)

Needs `cargo build --release --example read_layout` and pip install gdstk klayout numpy. "Read" means: the place and
width of every pillar in arrays. The flat file has one BOUNDARY a pillar, the referenced one SREF a pillar.
"""
import os
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

OURS = Path(__file__).resolve().parent.parent / "target/release/examples/read_layout"
PITCH = 350


def record(kind, data, body=b""):
    return struct.pack(">HBB", len(body) + 4, kind, data) + body


def name(text):
    return text.encode() + b"\0" * (len(text) % 2)


def real8(bits):
    return struct.pack(">Q", bits)


HEAD = (record(0, 2, struct.pack(">h", 600)) + record(1, 2, struct.pack(">12h", *[2026, 1, 1, 0, 0, 0] * 2))
        + record(2, 6, name("BENCH")) + record(3, 5, real8(0x3E4189374BC6A7F0) + real8(0x3944B82FA09B5A54)))
BEGIN = record(5, 2, struct.pack(">12h", *[2026, 1, 1, 0, 0, 0] * 2))


def lens(count):
    """Centres and widths of a disc of `count` pillars, row by row."""
    radius = np.sqrt(count / np.pi)
    k = np.arange(-int(radius) - 2, int(radius) + 2)
    x, y = np.meshgrid(k, k)
    r2 = (x + 0.5) ** 2 + (y + 0.5) ** 2
    inside = r2 <= radius**2
    turns = -(np.sqrt(r2[inside] * (PITCH * 1e-3) ** 2 + 4e6) - 2000) / 0.94 % 1
    width = 100 + 2 * np.rint(100 * turns).astype(np.int32)
    return (2 * x[inside] + 1) * PITCH // 2, (2 * y[inside] + 1) * PITCH // 2, width


def boundary_records(x, y, w):
    h = w // 2
    out = np.empty(len(x), dtype=[("head", "S20"), ("xy", ">i4", (5, 2)), ("tail", "S4")])
    head = record(8, 0) + record(0x0D, 2, b"\0\1") + record(0x0E, 2, b"\0\0") + struct.pack(">HBB", 44, 0x10, 3)
    out["head"], out["tail"] = head, record(0x11, 0)
    for k, (sx, sy) in enumerate([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]):
        out["xy"][:, k, 0], out["xy"][:, k, 1] = x + sx * h, y + sy * h
    raw = np.frombuffer(out.tobytes(), np.uint8).reshape(len(x), 64).copy()
    raw[:, :20] = np.frombuffer(head, np.uint8)
    raw[:, 60:] = np.frombuffer(record(0x11, 0), np.uint8)
    return raw.tobytes()


def reference_records(x, y, w):
    raw = np.zeros((len(x), 28), np.uint8)
    raw[:, :8] = np.frombuffer(record(0x0A, 0) + struct.pack(">HBB", 8, 0x12, 6), np.uint8)
    raw[:, 8] = ord("W")
    for k, power in enumerate([100, 10, 1]):
        raw[:, 9 + k] = ord("0") + w // power % 10
    raw[:, 12:16] = np.frombuffer(struct.pack(">HBB", 12, 0x10, 3), np.uint8)
    raw[:, 16:24] = np.stack([x, y], 1).astype(">i4").view(np.uint8).reshape(len(x), 8)
    raw[:, 24:] = np.frombuffer(record(0x11, 0), np.uint8)
    return raw.tobytes()


def write(folder, count):
    x, y, w = lens(count)
    cells = b"".join(BEGIN + record(6, 6, name(f"W{v}")) + boundary_records(*np.array([[0], [0], [v]])) + record(7, 0)
                     for v in np.unique(w))
    tail = record(7, 0) + record(4, 0)
    flat, sref = folder / "flat.gds", folder / "sref.gds"
    flat.write_bytes(HEAD + BEGIN + record(6, 6, name("TOP")) + boundary_records(x, y, w) + tail)
    sref.write_bytes(HEAD + cells + BEGIN + record(6, 6, name("TOP")) + reference_records(x, y, w) + tail)
    return flat, sref, len(x)


def gdstk_flat(path):
    import gdstk
    boxes = np.array([p.bounding_box() for p in gdstk.read_gds(path).top_level()[0].polygons])
    return len(boxes)


def gdstk_sref(path):
    import gdstk
    library = gdstk.read_gds(path)
    widths = {c.name: np.ptp(c.polygons[0].points[:, 0]) for c in library.cells if c.polygons}
    return len(np.array([(*r.origin, widths[r.cell.name]) for r in library.top_level()[0].references]))


def klayout_flat(path):
    import klayout.db as db
    layout = db.Layout()
    layout.read(path)
    boxes = [s.bbox() for s in layout.top_cell().each_shape(layout.layer(1, 0))]
    return len(np.array([(b.left + b.right, b.bottom + b.top, b.width()) for b in boxes]))


def klayout_sref(path):
    import klayout.db as db
    layout = db.Layout()
    layout.read(path)
    widths = {c.cell_index(): c.bbox().width() for c in layout.each_cell()}
    places = [(i.trans.disp.x, i.trans.disp.y, widths[i.cell_index]) for i in layout.top_cell().each_inst()]
    return len(np.array(places))


def timed(command):
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    output = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{command} failed")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, output.strip().splitlines()[-1]


def main():
    if len(sys.argv) > 2 and sys.argv[1] in PEERS:
        print(PEERS[sys.argv[1]](sys.argv[2]))
        return
    if len(sys.argv) > 3 and sys.argv[1] == "write":
        print(write(Path(sys.argv[3]), int(sys.argv[2]))[2])
        return
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 5_000_000
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(scratch)
        # In a process of its own: a child's peak memory counts what its parent holds when it begins.
        made = [sys.executable, __file__, "write", str(count), folder]
        pillars = int(subprocess.run(made, check=True, stdout=subprocess.PIPE, text=True).stdout)
        print(f"{pillars} pillars")
        for kind in ("flat", "sref"):
            path = folder / f"{kind}.gds"
            cpu, memory, last = timed([OURS, path])
            print(f"{kind}  ours     {cpu:6.2f} CPU s  {memory:7.0f} MB   {last}")
            for peer in ("gdstk", "klayout"):
                seconds, peak, last = timed([sys.executable, __file__, f"{peer}_{kind}", path])
                assert int(last) == pillars, last
                print(f"{kind}  {peer:8} {seconds:6.2f} CPU s  {peak:7.0f} MB   {seconds / cpu:.1f} x the CPU")


PEERS = {f.__name__: f for f in (gdstk_flat, gdstk_sref, klayout_flat, klayout_sref)}
main()
