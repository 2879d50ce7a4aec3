"""One lens optimised out of noise: ours beside torchoptics, on one machine in one go.

usage: python scripts/gradient_peers.py [DIAMETER_UM FOCAL_UM STEPS RUNS]
       (300 500 60 1 unless said; of several runs the one with the fewest CPU seconds counts)
needs: pip install ./python torch torchoptics; one that is not installed is listed as not run

The same in all: a round lens with sites 350 nm apart, at 530 nm; phases from the same noise; steps of Adam of PyTorch at a rate
of 0.3 on the negative light within 1 um of the focus; 32 x 32 samples about the focus, 350 nm apart. What differs is the
propagation: ours in single precision, accurate or `fast`; torchoptics in double precision, its default, and in single
precision, to the 32 x 32 samples (`window`), which it need not be told to do: unless told it takes the plane of the lens
(`plane`). The light that is reached, over that of the ideal lens, is judged for all by one sum over all sites in double precision.

CPU seconds are user + system of the steps, imports and planning not counted; memory is the most that the process had,
imports of PyTorch included (its own is shown as `torch alone`). PyTorch has one thread, with which all take the fewest CPU seconds.
"""
import json
import math
import resource
import subprocess
import sys
import time

PITCH, WAVELENGTH, RATE, WITHIN, SAMPLES = 0.35, 0.53, 0.3, 1.0, 32
WAYS = ["metalith", "metalith fast", "torchoptics window", "torchoptics window single", "torchoptics plane", "torch alone"]


def setup(arguments):
    """Diameter, focal length (um), steps and runs that are asked for."""
    global SITES, RADIUS, FOCAL, STEPS, RUNS
    given = [*map(float, arguments), *(300.0, 500.0, 60.0, 1.0)[len(arguments) :]]
    RADIUS, FOCAL, STEPS, RUNS = given[0] / 2, given[1], int(given[2]), int(given[3])
    SITES = 2 * math.ceil(RADIUS / PITCH)


def lens():
    """Places of the sites, where light passes, and the noise to start from."""
    import numpy as np

    x = (np.arange(SITES) - (SITES - 1) / 2) * PITCH
    open_sites = np.hypot.outer(x, x) <= RADIUS
    return x, open_sites, np.random.default_rng(60).uniform(0, 2 * np.pi, (SITES, SITES))


def light_within(phase):
    """The light near the focus of a lens with these phases, over that of the ideal lens: summed over all sites, in double precision."""
    import numpy as np

    x, open_sites, _ = lens()
    at = (np.arange(SAMPLES) - (SAMPLES - 1) / 2) * PITCH
    near = [(u, v) for u in at for v in at if np.hypot(u, v) <= WITHIN]
    k = 2 * np.pi / WAVELENGTH
    ideal = -k * np.sqrt(np.add.outer(x**2, x**2) + FOCAL**2)
    sums = []
    for phases in (phase, ideal):
        t = np.where(open_sites, np.exp(1j * phases), 0)
        light = 0.0
        for u, v in near:
            r = np.sqrt(np.add.outer((x - v) ** 2, (x - u) ** 2) + FOCAL**2)
            light += abs((t * np.exp(1j * k * r) / r**2 * (1 / r - 1j * k)).sum()) ** 2
        sums.append(light)
    return sums[0] / sums[1]


def merit_by_metalith(fast):
    import numpy as np
    import torch

    import metalith as ml
    import metalith.torch

    model = ml.PsfModel(
        SITES, pitch_nm=350, wavelength_nm=530, distance_um=FOCAL, diameter_um=2 * RADIUS, samples=SAMPLES, at_um=(PITCH / 2,) * 2,
        fast=fast,
    )
    weights = torch.tensor(np.hypot.outer(model.y_um, model.x_um) <= WITHIN, dtype=torch.float64)
    return lambda phase: (metalith.torch.psf(model, phase) * weights).sum(), torch.float64


def merit_by_torchoptics(dtype, samples):
    import numpy as np
    import torch
    from torchoptics import Field

    x, open_sites, _ = lens()
    near = (np.arange(samples) - (samples - 1) / 2) * PITCH
    inside = torch.tensor(np.hypot.outer(near, near) <= WITHIN)
    passes = torch.tensor(open_sites)

    def merit(phase):
        aperture = torch.polar(passes.to(dtype), phase)
        field = Field(aperture, wavelength=WAVELENGTH, spacing=PITCH)
        return field.propagate((samples, samples), FOCAL, spacing=PITCH).intensity()[inside].sum()

    return merit, dtype


def run(way):
    import torch

    if way == "torch alone":
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        return {"cpu_s": 0.0, "wall_s": 0.0, "peak_mb": peak, "light": 0.0}
    torch.set_num_threads(1)
    single = way.endswith("single")
    torch.set_default_dtype(torch.float32 if single else torch.float64)
    if way.startswith("metalith"):
        merit, dtype = merit_by_metalith(way.endswith("fast"))
    else:
        merit, dtype = merit_by_torchoptics(torch.float32 if single else torch.float64, SAMPLES if "window" in way else SITES)

    def steps(number):
        phase = torch.tensor(lens()[2], dtype=dtype, requires_grad=True)
        optimiser = torch.optim.Adam([phase], lr=RATE)
        for _ in range(number):
            optimiser.zero_grad()
            loss = -merit(phase)
            loss.backward()
            optimiser.step()
        return phase

    # What PyTorch imports at the first step is not counted.
    steps(1)
    cpu, wall = time.process_time(), time.perf_counter()
    phase = steps(STEPS)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {"cpu_s": cpu, "wall_s": wall, "peak_mb": peak, "light": light_within(phase.detach().double().numpy())}


def main():
    print(f"{2 * RADIUS:g} um, {SITES} x {SITES} sites, f = {FOCAL:g} um, {STEPS} steps")
    print(f"{'what':<28}{'CPU s':>9}{'wall s':>9}{'MB':>8}{'light':>8}{'x accurate':>12}{'x fast':>9}")
    ours = {}
    for way in WAYS:
        found = []
        for _ in range(RUNS):
            done = subprocess.run([sys.executable, __file__, *sys.argv[1:], "--way", way], capture_output=True, text=True)
            if done.returncode != 0:
                break
            found.append(json.loads(done.stdout.strip().splitlines()[-1]))
        if not found:
            reason = done.stderr.strip().splitlines()[-1:] or ["no message"]
            print(f"{way:<28}not run: {reason[0]}")
            continue
        best = min(found, key=lambda row: row["cpu_s"])
        if way == "torch alone":
            print(f"{way:<28}{'':>9}{'':>9}{best['peak_mb']:>8.0f}")
            continue
        if way in WAYS[:2]:
            ours[way] = best["cpu_s"]
        row = f"{way:<28}{best['cpu_s']:>9.2f}{best['wall_s']:>9.2f}{best['peak_mb']:>8.0f}{best['light']:>8.4f}"
        ratios = [best["cpu_s"] / ours[own] if own in ours else math.nan for own in WAYS[:2]]
        print(f"{row}{ratios[0]:>12.1f}{ratios[1]:>9.1f}", flush=True)


if __name__ == "__main__":
    if "--way" in sys.argv:
        setup(sys.argv[1:-2])
        print(json.dumps(run(sys.argv[-1])))
    else:
        setup(sys.argv[1:])
        main()
