"""Round pillars of one layout in GDSII and in OASIS by KLayout: no difference, every polygon a circle on the grid.

usage: python scripts/compare_circles.py PILLARS.gds PILLARS.oas
needs: pip install klayout
"""
import math
import sys

from compare_xor import region

# Half the diagonal of a step of the grid, and the chord error of the designs (nm).
ROUNDED, CHORD = 0.7072, 0.5


def main():
    gds, oasis = map(region, sys.argv[1:3])
    assert gds.count() > 0, "no pillars"
    apart = gds ^ oasis
    count, worst = 0, 0.0
    for polygon in gds.each():
        box = polygon.bbox()
        assert box.width() == box.height(), f"{box} is no box around a circle"
        radius, middle = box.width() / 2, box.center()
        corners = list(polygon.each_point_hull())
        off = max(abs(math.hypot(p.x - middle.x, p.y - middle.y) - radius) for p in corners)
        worst = max(worst, off)
        assert off <= ROUNDED, f"a corner {off:.2f} nm off the circle in {box}"
        for p, q in zip(corners, corners[1:] + corners[:1]):
            near = math.hypot((p.x + q.x) / 2 - middle.x, (p.y + q.y) / 2 - middle.y)
            assert radius - near <= CHORD + ROUNDED, f"a chord {radius - near:.2f} nm off the circle in {box}"
        count += 1
    print(f"{sys.argv[1]}: {count} circles, corners within {worst:.2f} nm, {apart.count()} differences from OASIS")
    sys.exit(0 if apart.is_empty() and count == oasis.count() else 1)


if __name__ == "__main__":
    main()
