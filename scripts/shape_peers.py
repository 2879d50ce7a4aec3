"""Cells of circles, on a square and on a hexagonal lattice, and of rotated rectangles: ours beside fmmax, which solves the
same cells by an independent code. With 17 orders an axis that takes seven CPU seconds a point; `--every 3` asks for each third.

usage: python scripts/shape_peers.py [--shape circle hexagonal rectangle] [--ours 13 17 21 25 33] [--peer 13 17] [--formulation JONES_DIRECT] [--every 1]
needs: pip install fmmax

Thirty points of each kind: silicon nitride, titanium dioxide and amorphous silicon, 455 to 1550 nm; circles of five diameters,
rectangles at five angles. Answers are Jones matrices of the zero order, field above the pillar over arriving field at its foot;
the distance of two is that of the entries farthest apart. All rows are held to ours with the most orders, to which both codes
should come as orders are added; what the peer keeps of a distance is its grid, of 1600 x 1600 places that are inside or not; on a hexagonal lattice along its two vectors, with as many orders as a square
lattice has, in a circle.
"""
import argparse
import json
import os
import subprocess
import sys
import time

GRID = 1600
GOAL = 0.005
KINDS = ["circle", "hexagonal", "rectangle"]


def raster(point, inside):
    import numpy as np

    pitch = point["pitch"]
    middles = (np.arange(GRID) + 0.5) / GRID * pitch - pitch / 2
    x, y = middles[:, None], middles[None, :]
    if point.get("hexagonal"):
        # Along u and v; the circle in the middle of the cell reaches no other.
        x, y = x + y / 2, y * np.sqrt(3) / 2
    if "diameter" in point:
        within = x**2 + y**2 < point["diameter"] ** 2 / 4
    else:
        angle = np.radians(point["degrees"])
        along, across = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
        width, length = point["size"]
        within = (abs(along) < width / 2) & (abs(across) < length / 2)
    return np.where(within, inside, 1.0)


def peer(point, along, formulation):
    import jax

    jax.config.update("jax_enable_x64", True)
    import fmmax
    import jax.numpy as jnp
    import numpy as np

    pitch, wavelength = point["pitch"], point["wavelength"]
    film, below = complex(*point["film"]), point["below"]
    lattice = fmmax.LatticeVectors(u=pitch * fmmax.X, v=pitch * fmmax.Y)
    truncation = fmmax.Truncation.PARALLELOGRAMIC
    if point.get("hexagonal"):
        lattice = fmmax.LatticeVectors(u=pitch * fmmax.X, v=pitch * (0.5 * fmmax.X + np.sqrt(0.75) * fmmax.Y))
        truncation = fmmax.Truncation.CIRCULAR
    expansion = fmmax.generate_expansion(lattice, approximate_num_terms=along**2, truncation=truncation)

    def layer(permittivity):
        return fmmax.eigensolve_isotropic_media(
            wavelength=jnp.asarray(wavelength), in_plane_wavevector=jnp.zeros((2,)), primitive_lattice_vectors=lattice,
            permittivity=jnp.asarray(permittivity, jnp.complex128), expansion=expansion,
            formulation=fmmax.Formulation[formulation])

    layers = [layer(np.full((1, 1), below**2)), layer(raster(point, film**2)), layer(np.ones((1, 1)))]
    s11 = fmmax.stack_s_matrix(layers, [jnp.asarray(0.0), jnp.asarray(point["height"]), jnp.asarray(0.0)]).s11
    half = s11.shape[0] // 2
    zero = int(np.where((np.asarray(expansion.basis_coefficients) == 0).all(1))[0][0])

    def field(at, waves):
        electric, _ = fmmax.fields_from_wave_amplitudes(waves[:, None], jnp.zeros_like(waves)[:, None], at)
        return np.array([complex(electric[0][zero, 0]), complex(electric[1][zero, 0])])

    basis = [jnp.zeros(2 * half, jnp.complex128).at[k].set(1.0) for k in (zero, half + zero)]
    arriving = np.stack([field(layers[0], wave) for wave in basis], 1)
    leaving = np.stack([field(layers[2], s11 @ wave) for wave in basis], 1)
    return (leaving @ np.linalg.inv(arriving)).ravel().tolist()


def ours(orders):
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    command = ["cargo", "run", "--release", "--quiet", "--example", "shapes", "--"]
    if program := os.environ.get("SHAPES"):
        command = [program]
    lines = subprocess.run(command + [*map(str, orders)], cwd=root, check=True, capture_output=True, text=True).stdout
    return {(row := json.loads(line))["orders"]: row["points"] for line in lines.splitlines()}


def compare(shape, found, options):
    kind = lambda p: "rectangle" if "size" in p else "hexagonal" if p["hexagonal"] else "circle"
    keep = [k for k, p in enumerate(next(iter(found.values()))) if kind(p) == shape][options.first :: options.every]
    points = [next(iter(found.values()))[k] for k in keep]
    rows = [(f"ours, {n}", [[complex(*t) for t in found[n][k]["jones"]] for k in keep]) for n in options.ours]
    for along in options.peer:
        begin = time.process_time()
        rows.append((f"fmmax, {along}", [peer(point, along, options.formulation) for point in points]))
        print(f"fmmax with {along} x {along} orders: {time.process_time() - begin:.0f} CPU s", flush=True)
    if len(options.peer) > 1:
        # What series leave out falls as one over the square of the orders an axis, nearly: where two of them would end.
        (low, before), (high, after) = zip(options.peer[-2:], [values for _, values in rows[-2:]])
        weight = 1 / ((high / low) ** 2 - 1)
        end = [[b + weight * (b - a) for a, b in zip(*both)] for both in zip(before, after)]
        rows.append((f"fmmax, {low} and {high} carried on", end))
    reference = rows[len(options.ours) - 1]
    title = {"circle": "circles", "hexagonal": "circles, hexagonal", "rectangle": "rectangles"}[shape] + ", orders an axis"
    far = lambda a, b: max(abs(x - y) for x, y in zip(a, b))
    print(f"\n{title:<34}{'rms':>9}{'median':>9}{'worst':>9}{'within':>9}   "
          f"distance from {reference[0]}; how many of {len(points)} within {GOAL}")
    for name, values in rows:
        apart = sorted(far(a, b) for a, b in zip(values, reference[1]))
        rms = (sum(d * d for d in apart) / len(apart)) ** 0.5
        print(f"{name:<34}{rms:>9.4f}{apart[len(apart) // 2]:>9.4f}{apart[-1]:>9.4f}{sum(d <= GOAL for d in apart):>9}")
    print()
    if options.points:
        for k, point in enumerate(points):
            what = f"{point.get('diameter', point.get('size'))} {point.get('degrees', '')}"
            print(f"{point['wavelength']:6.0f} nm, {what:<20}", *(f"{far(v[k], reference[1][k]):.4f}" for _, v in rows))
    return all(far(a, b) <= GOAL for a, b in zip(rows[options.judged][1], reference[1]))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--shape", nargs="+", default=KINDS, choices=KINDS)
    parser.add_argument("--ours", type=int, nargs="+", default=[13, 17, 21, 25, 33], help="the last is what the others are held to")
    parser.add_argument("--peer", type=int, nargs="*", default=[13, 17])
    parser.add_argument("--formulation", default="JONES_DIRECT", help="of fmmax")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="each N-th point alone")
    parser.add_argument("--first", type=int, default=0, metavar="K", help="from the K-th on, counted from zero")
    parser.add_argument("--points", action="store_true", help="distance of each point in each row")
    options = parser.parse_args()
    options.judged = len(options.ours) - 2 if len(options.ours) > 1 else 0
    found = ours(options.ours)
    good = [compare(shape, found, options) for shape in options.shape]
    sys.exit(0 if all(good) else 1)


if __name__ == "__main__":
    main()
