#!/usr/bin/env python3
"""The learnt prior beside the denoisers of scikit-image, on photographs of your own.

    python3 scripts/compare_denoisers.py target/release/metalith PHOTOGRAPH... [--noise 25] [--weights FILE]

Each photograph (grey ones as colours that are equal) gets normal noise of the given deviation (of 255, seed 1; the program
draws its own, numpy that of the others) and is denoised by `metalith denoise`, by total variation, by wavelets and by non-local means, each of the three
told the true deviation, with the settings of their documentation. PSNR in dB, against the photograph, values cut to what
a picture holds. Needs numpy, Pillow, scikit-image and PyWavelets; CPU seconds are those of the children and of this process.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image
from skimage import restoration

SEED = 1


def colours(path: Path) -> np.ndarray:
    """Values from 0 to 1 of an image, `[row, column, colour]`; grey as colours that are equal."""
    image = Image.open(path)
    if image.mode.startswith("I"):
        # Grey of 16 bits, which Pillow would cut at 255.
        grey = np.asarray(image, dtype=np.float64) / 65535
        return np.repeat(grey[:, :, np.newaxis], 3, axis=2)
    return np.asarray(image.convert("RGB"), dtype=np.float64) / 255


def psnr(found: np.ndarray, truth: np.ndarray) -> float:
    return float(-10 * np.log10(np.mean((np.clip(found, 0, 1) - truth) ** 2)))


def by_metalith(program: str, weights: list[str], path: Path, levels: float) -> float:
    command = [program, "denoise", str(path), "--noise", str(levels), "--add", "--seed", str(SEED), "--json", *weights]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)["psnr_db"]


def total_variation(noisy: np.ndarray, deviation: float) -> np.ndarray:
    # A weight of the deviation: near the best for most photographs.
    return restoration.denoise_tv_chambolle(noisy, weight=1.0 * deviation, channel_axis=-1)


def wavelets(noisy: np.ndarray, deviation: float) -> np.ndarray:
    return restoration.denoise_wavelet(
        noisy, sigma=deviation, channel_axis=-1, convert2ycbcr=True, method="BayesShrink", mode="soft", rescale_sigma=True
    )


def non_local(noisy: np.ndarray, deviation: float) -> np.ndarray:
    return restoration.denoise_nl_means(
        noisy, h=0.8 * deviation, sigma=deviation, fast_mode=True, patch_size=5, patch_distance=6, channel_axis=-1
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("photographs", nargs="+", type=Path)
    parser.add_argument("--noise", type=float, default=25.0, help="deviation, of 255")
    parser.add_argument("--weights", help="file of weights; those of the program if left out")
    args = parser.parse_args()
    deviation = args.noise / 255
    weights = ["--weights", args.weights] if args.weights else []
    ways = {
        "metalith": lambda path, noisy, clean: by_metalith(args.program, weights, path, args.noise),
        "total variation": lambda path, noisy, clean: psnr(total_variation(noisy, deviation), clean),
        "wavelets": lambda path, noisy, clean: psnr(wavelets(noisy, deviation), clean),
        "non-local means": lambda path, noisy, clean: psnr(non_local(noisy, deviation), clean),
    }
    print("| photograph | noisy | " + " | ".join(ways) + " |")
    print("| --- |" + " --- |" * (len(ways) + 1))
    sums: dict[str, list[float]] = {name: [] for name in ways}
    spent = dict.fromkeys(ways, 0.0)
    for path in args.photographs:
        clean = colours(path)
        noisy = clean + deviation * np.random.default_rng(SEED).standard_normal(clean.shape)
        row = []
        for name, way in ways.items():
            before = sum(os.times()[:4])
            row.append(way(path, noisy, clean))
            spent[name] += sum(os.times()[:4]) - before
            sums[name].append(row[-1])
        print(f"| {path.stem} | {psnr(noisy, clean):.2f} | " + " | ".join(f"{v:.2f}" for v in row) + " |")
        sys.stdout.flush()
    print("| mean | | " + " | ".join(f"{np.mean(v):.2f}" for v in sums.values()) + " |")
    print("| CPU s a photograph | | " + " | ".join(f"{spent[n] / len(sums[n]):.1f}" for n in ways) + " |")


if __name__ == "__main__":
    main()
