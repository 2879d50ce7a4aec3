#!/usr/bin/env python3
"""The learned perceptual distance by numpy and scipy in double precision, for numbers that a test makes too.

    pip install numpy scipy
    python3 scripts/lpips_reference.py

Prints the distance that `crates/prior/src/perceptual.rs` is held against. The network has the shapes of AlexNet and
weights that are sines: the published ones are not needed to tell whether two programs compute the same.
"""

import numpy
from scipy.signal import correlate2d

STAGES = [(3, 64, 11, 4, 2, False), (64, 192, 5, 1, 2, True), (192, 384, 3, 1, 1, True),
          (384, 256, 3, 1, 1, False), (256, 256, 3, 1, 1, False)]
MEAN = numpy.array([-0.030, -0.088, -0.188])
DEVIATION = numpy.array([0.458, 0.448, 0.450])


def numbers(count, layer):
    return numpy.sin(0.7 * numpy.arange(count) + layer).astype(numpy.float32).astype(float)


def picture(frequency):
    y, x, c = numpy.meshgrid(numpy.arange(71), numpy.arange(83), numpy.arange(3), indexing="ij")
    return 0.5 + 0.4 * numpy.sin(frequency * (y + 2.0 * x) + c)


def pool(features):
    """The greatest of three by three, every second place."""
    _, rows, columns = features.shape
    down, across = (rows - 3) // 2 + 1, (columns - 3) // 2 + 1
    parts = [features[:, i : i + 2 * down - 1 : 2, j : j + 2 * across - 1 : 2] for i in range(3) for j in range(3)]
    return numpy.max(parts, axis=0)


def main():
    both = [((2 * picture(f) - 1 - MEAN) / DEVIATION).transpose(2, 0, 1) for f in (0.11, 0.17)]
    total = 0.0
    for k, (inner, outer, taps, stride, margin, pooled) in enumerate(STAGES):
        weights = numbers(outer * inner * taps * taps, k).reshape(outer, inner, taps, taps) * 2 / (inner * taps * taps) ** 0.5
        bias, counts = 0.1 * numbers(outer, k + 10), abs(numbers(outer, k + 20))
        found = []
        for features in both:
            features = pool(features) if pooled else features
            features = numpy.pad(features, ((0, 0), (margin, margin), (margin, margin)))
            planes = [sum(correlate2d(features[i], weights[o, i], "valid") for i in range(inner)) + bias[o] for o in range(outer)]
            found.append(numpy.maximum(numpy.array(planes)[:, ::stride, ::stride], 0))
        both = found
        unit = [f / (numpy.sqrt((f**2).sum(0)) + 1e-10) for f in both]
        total += ((unit[0] - unit[1]) ** 2 * counts[:, None, None]).sum(0).mean()
    print(f"{total:.8f}")


main()
