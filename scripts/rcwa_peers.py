"""One cell of the metalens: ours beside published RCWA codes, on one machine in one go, one thread each.

usage: python scripts/rcwa_peers.py [--orders 13 17] [grcwa] [meent] [fmmax]     (all three unless named)
needs: pip install grcwa meent fmmax; a peer that is not installed is listed as not run

Square pillar of silicon nitride, 700 nm high on a pitch of 350 nm, from fused silica to air, along the normal, polarised
along x. CPU seconds are user + system of one cell, mean of three, after one that is not counted (compilers warm up
there). The last column is the largest distance of |t| to ours: codes converge differently, at equal orders they differ.
"""
import json
import os
import subprocess
import sys
import time

POINTS = [(200.0, 452.0), (280.0, 452.0), (250.0, 525.0)]
PITCH, HEIGHT, GRID = 350.0, 700.0, 350
PEERS = ["grcwa", "meent", "fmmax"]
ONE_THREAD = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
}


def sellmeier(length_um, terms):
    l2 = length_um**2
    return (1 + sum(b * l2 / (l2 - c * c) for b, c in terms)) ** 0.5


def indices(wavelength_nm):
    l = wavelength_nm / 1e3
    film = sellmeier(l, [(3.0249, 0.1353406), (40314, 1239.842)])
    silica = sellmeier(l, [(0.6961663, 0.0684043), (0.4079426, 0.1162414), (0.8974794, 9.896161)])
    return film, silica


def raster(width, inside, outside=1.0):
    import numpy as np

    x = (np.arange(GRID) + 0.5) / GRID * PITCH - PITCH / 2
    within = abs(x) < width / 2
    return np.where(within[:, None] & within[None, :], inside, outside)


def with_grcwa(width, wavelength, highest):
    import grcwa

    film, silica = indices(wavelength)
    cell = grcwa.obj((2 * highest + 1) ** 2, [PITCH, 0], [0, PITCH], 1 / wavelength, 0.0, 0.0, verbose=0)
    cell.Add_LayerUniform(0.0, silica**2)
    cell.Add_LayerGrid(HEIGHT, GRID, GRID)
    cell.Add_LayerUniform(0.0, 1.0)
    cell.Init_Setup(Gmethod=1)
    cell.GridLayer_geteps(raster(width, film**2).flatten())
    cell.MakeExcitationPlanewave(1.0, 0.0, 0.0, 0.0, order=0)
    field, _ = cell.Solve_FieldFourier(2, 0.0)
    # A unit amplitude there is that of the magnetic field in the glass.
    return abs(complex(field[0][cell.G.tolist().index([0, 0])])) * silica


def with_meent(width, wavelength, highest):
    import meent
    import numpy as np

    film, silica = indices(wavelength)
    shape = [[1.0, [["rectangle", PITCH / 2, PITCH / 2, width, width, film]]]]
    solver = meent.call_mee(backend=0, n_top=silica, n_bot=1.0, theta=0.0, phi=0.0, pol=1, fto=[highest, highest],
                            period=[PITCH, PITCH], wavelength=wavelength, thickness=[HEIGHT], ucell=shape)
    orders = np.asarray(solver.conv_solve().res.T_p)
    return abs(complex(orders[orders.shape[0] // 2, orders.shape[1] // 2]))


COMPILED = {}


def with_fmmax(width, wavelength, highest):
    import jax

    jax.config.update("jax_enable_x64", True)
    import fmmax
    import jax.numpy as jnp
    import numpy as np

    film, silica = indices(wavelength)
    lattice = fmmax.LatticeVectors(u=PITCH * fmmax.X, v=PITCH * fmmax.Y)
    expansion = fmmax.generate_expansion(lattice, approximate_num_terms=(2 * highest + 1) ** 2,
                                         truncation=fmmax.Truncation.PARALLELOGRAMIC)

    def stack(permittivity, length, below):
        def layer(e):
            return fmmax.eigensolve_isotropic_media(
                wavelength=length, in_plane_wavevector=jnp.zeros((2,)), primitive_lattice_vectors=lattice,
                permittivity=e, expansion=expansion, formulation=fmmax.Formulation.JONES_DIRECT)

        layers = [layer(below.reshape(1, 1)), layer(permittivity), layer(jnp.ones((1, 1), permittivity.dtype))]
        return fmmax.stack_s_matrix(layers, [jnp.asarray(0.0), jnp.asarray(HEIGHT), jnp.asarray(0.0)]).s11, layers

    solve = COMPILED.setdefault(highest, jax.jit(stack))
    s11, layers = solve(jnp.asarray(raster(width, film**2), jnp.complex128), jnp.asarray(wavelength),
                        jnp.asarray(silica**2, jnp.complex128))
    half = s11.shape[0] // 2
    zero = int(np.where((np.asarray(expansion.basis_coefficients) == 0).all(1))[0][0])

    def field(layer, waves):
        electric, _ = fmmax.fields_from_wave_amplitudes(waves[:, None], jnp.zeros_like(waves)[:, None], layer)
        return np.array([complex(electric[0][zero, 0]), complex(electric[1][zero, 0])])

    basis = [jnp.zeros(2 * half, jnp.complex128).at[k].set(1.0) for k in (zero, half + zero)]
    arriving = np.stack([field(layers[0], wave) for wave in basis], 1)
    leaving = np.stack([field(layers[2], s11 @ wave) for wave in basis], 1)
    return abs((leaving @ np.linalg.inv(arriving))[0, 0])


def run_peer(name, highest):
    solve = {"grcwa": with_grcwa, "meent": with_meent, "fmmax": with_fmmax}[name]
    solve(190.0, 452.0, highest)
    cpu = time.process_time()
    moduli = [float(solve(*point, highest)) for point in POINTS]
    print(json.dumps({"cpu_s": (time.process_time() - cpu) / len(POINTS), "moduli": moduli}))


def main():
    names = [a for a in sys.argv[1:] if a in PEERS] or PEERS
    orders = [int(a) for a in sys.argv[1:] if a.isdigit()] or [13, 17]
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    command = ["cargo", "run", "--release", "--locked", "--quiet", "--example", "cell", "--", *map(str, orders)]
    lines = subprocess.run(command, cwd=root, check=True, capture_output=True, text=True).stdout.splitlines()
    print(f"{'what':<12}{'orders':>9}{'CPU ms':>10}{'ratio':>8}{'| |t| - ours |':>16}")
    for line in lines:
        ours = json.loads(line)
        along = ours["orders"]
        moduli = [abs(complex(*t)) for t in ours["t"]]
        print(f"{'metalith':<12}{f'{along} x {along}':>9}{ours['cpu_s'] * 1e3:>10.2f}")
        for name in names:
            done = subprocess.run([sys.executable, __file__, "--peer", name, str(along // 2)], capture_output=True,
                                  text=True, env={**os.environ, **ONE_THREAD})
            if done.returncode != 0:
                reason = done.stderr.strip().splitlines()[-1:] or ["no message"]
                print(f"{name:<12}{'':>9}  not run: {reason[0]}")
                continue
            row = json.loads(done.stdout.strip().splitlines()[-1])
            distance = max(abs(a - b) for a, b in zip(row["moduli"], moduli))
            ratio = row["cpu_s"] / ours["cpu_s"]
            print(f"{name:<12}{f'{along} x {along}':>9}{row['cpu_s'] * 1e3:>10.1f}{ratio:>8.0f}{distance:>16.3f}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--peer"]:
        run_peer(sys.argv[2], int(sys.argv[3]))
    else:
        main()
