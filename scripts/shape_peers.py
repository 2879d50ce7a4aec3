"""Cells of circles, on a square and on a hexagonal lattice, and of rotated and upright rectangles: ours beside fmmax and meent, which solve the
same cells by independent codes. With 17 orders an axis that takes seven CPU seconds a point; `--every 3` asks for each third.

usage: python scripts/shape_peers.py [--shape circle hexagonal rectangle aligned upright] [--ours 13 17 21 25 33] [--peer 13 17] [--formulation JONES_DIRECT] [--every 1]
needs: pip install fmmax meent

Thirty points of each kind: silicon nitride, titanium dioxide and amorphous silicon, 455 to 1550 nm; circles of five diameters,
rectangles at five angles. Answers are Jones matrices of the zero order, field above the pillar over arriving field at its foot;
the distance of two is that of the entries farthest apart. All rows are held to ours with the most orders, to which both codes
should come as orders are added; what the peer keeps of a distance is its grid, of 1600 x 1600 places that are inside or not; on a hexagonal lattice along its two vectors, with as many orders as a square
lattice has, in a circle.

`aligned` asks meent, which takes rectangles along the axes only, and takes them exactly: fifteen sizes as they are, and turned by 45
degrees, where two of them fill a square cell along their edges whose pitch is the root of two. Orders are for each pitch of
pillars, in the larger cell as many more. `upright` asks it for the same fifteen as they are, beside our rule for sides along the axes:
thirty transmissions, of light along x and along y.
"""
import argparse
import json
import os
import subprocess
import sys
import time

GRID = 1600
GOAL = 0.005
KINDS = ["circle", "hexagonal", "rectangle", "aligned", "upright"]


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


def aligned_peer(point, along):
    import meent
    import numpy as np

    pillars = {0: 1, 45: 2}[point["degrees"]]
    period = point["pitch"] * pillars**0.5
    # The other sign of time: indices and answers are conjugated.
    film = complex(*point["film"]).conjugate()

    def parts(middle, length):
        """Of an interval that may reach over the border of the cell: middle and length of each part."""
        low, high = middle - length / 2, middle + length / 2
        ends = [(low, high)]
        if low < 0:
            ends = [(0, high), (low + period, period)]
        elif high > period:
            ends = [(low, period), (0, high - period)]
        return [((a + b) / 2, b - a) for a, b in ends]

    middles = [(0.5 + k / pillars) % 1 * period for k in range(pillars)]
    width, length = point["size"]
    rectangles = [["rectangle", x, y, w, l, film] for at in middles for x, w in parts(at, width) for y, l in parts(at, length)]
    highest = round((along * pillars**0.5 - 1) / 2)
    # Half of the light along each edge: one solution for both, which no cell with mirrors converts into one another.
    solver = meent.call_mee(backend=0, n_top=point["below"], n_bot=1.0, theta=0.0, phi=0.0, psi=np.pi / 4, fto=[highest, highest],
                            period=[period, period], wavelength=point["wavelength"], thickness=[point["height"]],
                            ucell=[[1.0, rectangles]])
    found = solver.conv_solve().res
    zero = lambda table: complex(table[table.shape[0] // 2, table.shape[1] // 2]) * 2**0.5
    # Of a bare layer both are the closed form: s as it is, p a quarter of a turn ahead.
    across, over = zero(np.asarray(found.T_p) / 1j).conjugate(), zero(np.asarray(found.T_s)).conjugate()
    angle = np.radians(point["degrees"])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return (turn @ np.diag([across, over]) @ turn.T).ravel().tolist()


def ours(orders, shapes):
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    command = ["cargo", "run", "--release", "--locked", "--quiet", "--example", "shapes", "--"]
    if program := os.environ.get("SHAPES"):
        command = [program]
    # A circle on either lattice is one kind of the example, rectangles at all angles another.
    kinds = {"circle": "circle", "hexagonal": "circle", "rectangle": "rectangle", "aligned": "rectangle", "upright": "upright"}
    asked = sorted({kinds[shape] for shape in shapes})
    lines = subprocess.run(command + [*map(str, orders), *asked], cwd=root, check=True, capture_output=True, text=True).stdout
    return {(row := json.loads(line))["orders"]: row["points"] for line in lines.splitlines()}


def compare(shape, found, options):
    kind = lambda p: "upright" if "upright" in p else "aligned" if "aligned" in p else "rectangle" if "size" in p else "hexagonal" if p["hexagonal"] else "circle"
    keep = [k for k, p in enumerate(next(iter(found.values()))) if kind(p) == shape][options.first :: options.every]
    points = [next(iter(found.values()))[k] for k in keep]
    rows = [(f"ours, {n}", [[complex(*t) for t in found[n][k]["jones"]] for k in keep]) for n in options.ours]
    by_edges = shape in ("aligned", "upright")
    code = "meent" if by_edges else "fmmax"
    for along in options.peer:
        begin = time.process_time()
        solve = aligned_peer if by_edges else lambda point, along: peer(point, along, options.formulation)
        rows.append((f"{code}, {along}", [solve(point, along) for point in points]))
        print(f"{code} with {along} x {along} orders: {time.process_time() - begin:.0f} CPU s", flush=True)
    if len(options.peer) > 1:
        # What series leave out falls as one over the square of the orders an axis, nearly: where two of them would end.
        (low, before), (high, after) = zip(options.peer[-2:], [values for _, values in rows[-2:]])
        weight = 1 / ((high / low) ** 2 - 1)
        end = [[b + weight * (b - a) for a, b in zip(*both)] for both in zip(before, after)]
        rows.append((f"{code}, {low} and {high} carried on", end))
    reference = rows[len(options.ours) - 1]
    title = {"circle": "circles", "hexagonal": "circles, hexagonal", "rectangle": "rectangles", "aligned": "rectangles along a larger cell", "upright": "upright rectangles"}[shape] + ", orders an axis"
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
    found = ours(options.ours, options.shape)
    good = [compare(shape, found, options) for shape in options.shape]
    sys.exit(0 if all(good) else 1)


if __name__ == "__main__":
    main()
