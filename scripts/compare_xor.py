"""Pillars of several files by KLayout: as many in each, and no difference from the first.

usage: python scripts/compare_xor.py PILLARS OTHER [OTHER ...]
needs: pip install klayout
"""
import sys

import klayout.db as db


def region(path):
    layout = db.Layout()
    layout.read(path)
    flat = db.Region()
    flat.insert(layout.top_cell().begin_shapes_rec(layout.layer(1, 0)))
    return flat


def main():
    first, *others = sys.argv[1:]
    pillars = region(first)
    assert others and pillars.count() > 0, "no pillars, or nothing to compare them with"
    for other in others:
        found = region(other)
        apart = (pillars ^ found).count()
        assert found.count() == pillars.count() and apart == 0, f"{other}: {found.count()} pillars, {apart} differences"
    print(f"{first}: {pillars.count()} pillars, the same in {len(others)} other files")


if __name__ == "__main__":
    main()
