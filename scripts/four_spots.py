"""The phases of designs/phases/four_spots.npy: light of a lens into four spots of equal power about its focus.

usage: python scripts/four_spots.py OUT.npy
needs: numpy

Weighted iteration of Gerchberg and Saxton on the sites of a lens of 60 um on a lattice of 0.35 um (Di Leonardo, Ianni and
Ruocco, Opt. Express 15, 1913 (2007)), 60 steps from fixed phases: the same file on every machine. Spots are 10 and 14 um from
the focus, 144 um behind the lens, at 532 nm. float32, shape [172, 172], rad, lowest row first.
"""
import sys

import numpy as np

SITES, PITCH, DIAMETER, DISTANCE, WAVELENGTH = 172, 0.35, 60.0, 144.0, 0.532
SPOTS = [(10.0, 0.0), (0.0, 10.0), (-14.0, 0.0), (0.0, -14.0)]
STEPS = 60


def main():
    at = (np.arange(SITES) - (SITES - 1) / 2) * PITCH
    x, y = np.meshgrid(at, at)
    inside = x**2 + y**2 <= DIAMETER**2 / 4
    ramps = [2 * np.pi / WAVELENGTH * (x * sx + y * sy) / DISTANCE for sx, sy in SPOTS]
    weights, phases = np.ones(len(SPOTS)), np.array([0.0, 1.0, 2.5, 4.0])
    for _ in range(STEPS):
        total = sum(w * np.exp(1j * (r + p)) for w, r, p in zip(weights, ramps, phases))
        phase = np.angle(total)
        field = [np.mean(np.exp(1j * (phase - r))[inside]) for r in ramps]
        size = np.abs(field)
        weights *= size.mean() / size
        phases = np.angle(field)
    share = size**2
    print(f"share of the light in each spot, even illumination: {np.round(share, 4)}, together {share.sum():.4f}")
    np.save(sys.argv[1], np.where(inside, phase, 0.0).astype(np.float32))


if __name__ == "__main__":
    main()
