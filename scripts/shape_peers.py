"""Cells of circles: ours beside fmmax, which solves the same cells by an independent code with a vector formulation.

usage: python scripts/shape_peers.py [--ours 21] [--peer 17 21]
needs: pip install fmmax

Thirty points: silicon nitride, titanium dioxide and amorphous silicon, 455 to 1550 nm, five diameters each. Both answers are
field above the pillar over arriving field at its foot. The peer sees the circle on a grid of 400 x 400, smoothed at its rim by
8 x 8 samples of each place.
"""
import argparse
import json
import os
import subprocess
import sys
import time

GRID, SAMPLES = 400, 8
GOAL = 0.005


def raster(diameter, pitch, inside):
    import numpy as np

    fine = GRID * SAMPLES
    x = (np.arange(fine) + 0.5) / fine * pitch - pitch / 2
    within = (x[:, None] ** 2 + x[None, :] ** 2 < diameter**2 / 4).astype(float)
    share = within.reshape(GRID, SAMPLES, GRID, SAMPLES).mean((1, 3))
    return 1.0 + share * (inside - 1.0)


def peer(point, along):
    import jax

    jax.config.update("jax_enable_x64", True)
    import fmmax
    import jax.numpy as jnp
    import numpy as np

    pitch, wavelength = point["pitch"], point["wavelength"]
    film, below = complex(*point["film"]), point["below"]
    lattice = fmmax.LatticeVectors(u=pitch * fmmax.X, v=pitch * fmmax.Y)
    expansion = fmmax.generate_expansion(lattice, approximate_num_terms=along**2,
                                         truncation=fmmax.Truncation.PARALLELOGRAMIC)

    def layer(permittivity):
        return fmmax.eigensolve_isotropic_media(
            wavelength=jnp.asarray(wavelength), in_plane_wavevector=jnp.zeros((2,)), primitive_lattice_vectors=lattice,
            permittivity=jnp.asarray(permittivity, jnp.complex128), expansion=expansion,
            formulation=fmmax.Formulation.JONES_DIRECT)

    layers = [layer(np.full((1, 1), below**2)), layer(raster(point["diameter"], pitch, film**2)), layer(np.ones((1, 1)))]
    s11 = fmmax.stack_s_matrix(layers, [jnp.asarray(0.0), jnp.asarray(point["height"]), jnp.asarray(0.0)]).s11
    half = s11.shape[0] // 2
    zero = int(np.where((np.asarray(expansion.basis_coefficients) == 0).all(1))[0][0])

    def field(at, waves):
        electric, _ = fmmax.fields_from_wave_amplitudes(waves[:, None], jnp.zeros_like(waves)[:, None], at)
        return np.array([complex(electric[0][zero, 0]), complex(electric[1][zero, 0])])

    basis = [jnp.zeros(2 * half, jnp.complex128).at[k].set(1.0) for k in (zero, half + zero)]
    arriving = np.stack([field(layers[0], wave) for wave in basis], 1)
    leaving = np.stack([field(layers[2], s11 @ wave) for wave in basis], 1)
    return complex((leaving @ np.linalg.inv(arriving))[0, 0])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ours", type=int, nargs="+", default=[13, 17, 21])
    parser.add_argument("--peer", type=int, nargs="+", default=[21])
    options = parser.parse_args()
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    command = ["cargo", "run", "--release", "--quiet", "--example", "shapes", "--", *map(str, options.ours)]
    if program := os.environ.get("SHAPES"):
        command = [program, *map(str, options.ours)]
    lines = subprocess.run(command, cwd=root, check=True, capture_output=True, text=True).stdout.splitlines()
    ours = {(row := json.loads(line))["orders"]: row["points"] for line in lines}
    points = next(iter(ours.values()))
    theirs = {}
    for along in options.peer:
        begin = time.process_time()
        theirs[along] = [peer(point, along) for point in points]
        print(f"fmmax with {along} x {along} orders: {time.process_time() - begin:.0f} CPU s", flush=True)
    reference = theirs[max(options.peer)]
    value = lambda point: complex(*point["t"])
    rows = [(f"ours, {n}", [value(p) for p in ours[n]]) for n in options.ours]
    rows += [(f"fmmax, {n}", theirs[n]) for n in options.peer]
    print(f"\n{'orders along an axis':<22}{'rms':>9}{'worst':>9}   distance of t from fmmax with {max(options.peer)}")
    for name, values in rows:
        apart = [abs(a - b) for a, b in zip(values, reference)]
        print(f"{name:<22}{(sum(d * d for d in apart) / len(apart)) ** 0.5:>9.4f}{max(apart):>9.4f}")
    print()
    best = [value(p) for p in ours[max(options.ours)]]
    for point, a, b in zip(points, best, reference):
        print(f"{point['wavelength']:6.0f} nm, {point['diameter']:4.0f} nm: ours {a:.4f}, fmmax {b:.4f}, apart {abs(a - b):.4f}")
    within = sum(abs(a - b) <= GOAL for a, b in zip(best, reference))
    print(f"\n{within} of {len(best)} points within {GOAL}")
    sys.exit(0 if within == len(best) else 1)


if __name__ == "__main__":
    main()
