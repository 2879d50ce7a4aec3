"""One monochromatic PSF of a 1 mm lens: ours beside what a user would pick instead, on one machine in one go.

usage: python scripts/diffraction_peers.py [scipy] [torchoptics] [diffractio]     (all three unless named)
needs: pip install scipy torchoptics diffractio; a peer that is not installed is listed as not run

The lens is that of golden/truth/diffraction_rs.csv at 452 nm, f = 2 mm: peers get its complex field as an array that is
not counted, ours forms its phase while it goes. CPU seconds are user + system of the propagation alone; memory is the
most that the process had, everything included. The error is that of |E|^2 at the focus.
"""
import json
import os
import resource
import subprocess
import sys
import time

PITCH, SITES, FOCAL, RADIUS, WAVELENGTH = 0.35, 2857, 2000.0, 500.0, 0.452
TRUTH = 710208.0796263948
PEERS = ["scipy", "torchoptics", "diffractio"]


def lens():
    import numpy as np

    x = (np.arange(SITES) - SITES // 2) * PITCH
    r2 = x[:, None] ** 2 + x[None, :] ** 2
    path = np.sqrt(r2 + FOCAL**2) - FOCAL
    return x, np.where(r2 <= RADIUS**2, np.exp(-2j * np.pi / WAVELENGTH * path), 0)


def with_scipy(x, u):
    """Band-limited angular spectrum on twice the lens, the whole plane."""
    import numpy as np
    import scipy.fft as fft

    n = 5760
    f = fft.fftfreq(n, PITCH)
    rest = 1 / WAVELENGTH**2 - f[:, None] ** 2 - f[None, :] ** 2
    limit = 1 / (WAVELENGTH * np.sqrt((2 * FOCAL / (n * PITCH)) ** 2 + 1))
    kept = (rest > 0) & (abs(f)[:, None] < limit) & (abs(f)[None, :] < limit)
    way = np.where(kept, np.exp(2j * np.pi * FOCAL * (np.sqrt(np.maximum(rest, 0)) - 1 / WAVELENGTH)), 0)
    return fft.ifft2(fft.fft2(u, (n, n)) * way)


def with_torchoptics(x, u):
    import torch
    from torchoptics import Field

    field = Field(torch.from_numpy(u), wavelength=WAVELENGTH, spacing=PITCH)
    return field.propagate_to_z(FOCAL).data.numpy()


def with_diffractio(x, u):
    from diffractio.scalar_masks_XY import Scalar_mask_XY

    mask = Scalar_mask_XY(x, x, WAVELENGTH)
    mask.u = u
    return mask.RS(z=FOCAL, new_field=True, verbose=False).u


def run_peer(name):
    x, u = lens()
    propagate = {"scipy": with_scipy, "torchoptics": with_torchoptics, "diffractio": with_diffractio}[name]
    cpu, wall = time.process_time(), time.perf_counter()
    field = propagate(x, u)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    centre = float(abs(field[SITES // 2, SITES // 2]) ** 2)
    print(json.dumps({"cpu_s": cpu, "wall_s": wall, "peak_mb": peak, "centre": centre}))


def run_ours(mode, repeats):
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    command = ["cargo", "run", "--release", "--locked", "--quiet", "--example", "focus", "--", mode, str(repeats)]
    lines = subprocess.run(command, cwd=root, check=True, capture_output=True, text=True).stdout.splitlines()
    return [json.loads(line) for line in lines]


def main():
    names = sys.argv[1:] or PEERS
    print(f"{'what':<38}{'CPU s':>9}{'MB':>8}{'error':>10}{'x accurate':>12}{'x fast':>9}")
    ours = {}
    for mode, repeats in [("accurate", 5), ("fast", 20)]:
        rows = run_ours(mode, repeats)
        ours[mode] = rows[0]["cpu_s"]
        for row in rows:
            label = f"metalith {mode}, {row['lens']}"
            print(f"{label:<38}{row['cpu_s']:>9.3f}{row['peak_mb']:>8.0f}{row['error']:>10.1e}")
    for name in names:
        done = subprocess.run([sys.executable, __file__, "--peer", name], capture_output=True, text=True)
        if done.returncode != 0:
            reason = done.stderr.strip().splitlines()[-1:] or ["no message"]
            print(f"{name:<38}not run: {reason[0]}")
            continue
        row = json.loads(done.stdout.strip().splitlines()[-1])
        error = abs(row["centre"] / TRUTH - 1)
        ratios = [row["cpu_s"] / ours[mode] for mode in ("accurate", "fast")]
        print(f"{name:<38}{row['cpu_s']:>9.2f}{row['peak_mb']:>8.0f}{error:>10.1e}{ratios[0]:>12.0f}{ratios[1]:>9.0f}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--peer"]:
        run_peer(sys.argv[2])
    else:
        main()
