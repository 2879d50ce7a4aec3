"""Rectangular pillars of one layout in GDSII and in OASIS by KLayout: no difference, every polygon a rectangle of one size at a
whole number of steps, its corners on the grid; or an upright one, both edges of so many lengths.

usage: python scripts/compare_rectangles.py PILLARS.gds PILLARS.oas WIDTH_NM LENGTH_NM STEP_DEG
       python scripts/compare_rectangles.py PILLARS.gds PILLARS.oas upright SHORTEST_NM STEP_NM LENGTHS
needs: pip install klayout
"""
import math
import sys

from compare_circles import ROUNDED
from compare_xor import region


def off_rectangle(corners, width, length, step):
    """Largest distance of a corner from that of the rectangle at the nearest rotation."""
    (ax, ay), (bx, by), (cx, cy) = corners[:3]
    first, second = (bx - ax, by - ay), (cx - bx, cy - by)
    long = max(first, second, key=lambda e: math.hypot(*e))
    rotation = math.atan2(long[1], long[0]) - math.pi / 2
    rotation = round(rotation / step) * step
    cos, sin = math.cos(rotation), math.sin(rotation)
    true = [(cos * x - sin * y, sin * x + cos * y) for x in (-width / 2, width / 2) for y in (-length / 2, length / 2)]
    return max(min(math.dist(c, t) for t in true) for c in corners)


def off_upright(corners, shortest, step, lengths):
    """Largest distance of a corner from that of the upright rectangle with the nearest edges."""
    edges = [max(c[axis] for c in corners) - min(c[axis] for c in corners) for axis in (0, 1)]
    x, y = [(shortest + step * min(max(round((e - shortest) / step), 0), lengths - 1)) / 2 for e in edges]
    true = [(a, b) for a in (-x, x) for b in (-y, y)]
    return max(min(math.dist(c, t) for t in true) for c in corners)


def main():
    gds, oasis = map(region, sys.argv[1:3])
    if sys.argv[3] == "upright":
        numbers = [int(v) for v in sys.argv[4:7]]
        off_its = lambda corners: off_upright(corners, *numbers)
    else:
        width, length, step = float(sys.argv[3]), float(sys.argv[4]), math.radians(float(sys.argv[5]))
        off_its = lambda corners: off_rectangle(corners, width, length, step)
    assert gds.count() > 0, "no pillars"
    apart = gds ^ oasis
    count, worst = 0, 0.0
    for polygon in gds.each():
        middle = polygon.bbox().center()
        corners = [(p.x - middle.x, p.y - middle.y) for p in polygon.each_point_hull()]
        assert len(corners) == 4, f"{len(corners)} corners at {middle}"
        off = off_its(corners)
        worst = max(worst, off)
        assert off <= ROUNDED, f"a corner {off:.2f} nm off its rectangle at {middle}"
        count += 1
    print(f"{sys.argv[1]}: {count} rectangles, corners within {worst:.2f} nm, {apart.count()} differences from OASIS")
    sys.exit(0 if apart.is_empty() and count == oasis.count() else 1)


if __name__ == "__main__":
    main()
