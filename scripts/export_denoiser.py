#!/usr/bin/env python3
"""Weights of the learnt prior as a network in ONNX, for other programs, and as an example of what `--prior FILE.onnx` takes.

    python3 scripts/export_denoiser.py crates/prior/weights/denoiser.safetensors denoiser.onnx

One input `noisy`, [1, 6, rows, columns]: red, green and blue in sRGB values from 0 to 1, and the deviation of the noise of each;
one output `clean`, [1, 3, rows, columns]. Both sides are multiples of 8. Needs numpy, onnx and safetensors.
"""

import sys

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper
from safetensors.numpy import load_file

LEVELS = 3
BLOCKS = 2


class Graph:
    """Nodes in the order in which they are added."""

    def __init__(self, weights):
        self.weights, self.nodes, self.constants, self.count = weights, [], [], 0

    def add(self, kind, inputs, **attributes):
        self.count += 1
        self.nodes.append(helper.make_node(kind, inputs, [f"x{self.count}"], **attributes))
        return f"x{self.count}"

    def constant(self, name, values):
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(values), name))
        return name

    def convolution(self, name, x, squares_in=False):
        values = self.weights[f"{name}.weight"].astype(np.float32)
        if squares_in:
            values = values[:, squares_last(values.shape[1])]
        side = values.shape[-1]
        border = {"pads": [side // 2] * 4}
        return self.add("Conv", [x, self.constant(name, values)], kernel_shape=[side, side], **border)

    def squares(self, x):
        return self.add("SpaceToDepth", [x], blocksize=2)

    def pixels(self, x):
        return self.add("DepthToSpace", [x], blocksize=2, mode="CRD")

    def blocks(self, name, x):
        for block in range(BLOCKS):
            between = self.add("Relu", [self.convolution(f"{name}.{block}.first", x)])
            x = self.add("Add", [x, self.convolution(f"{name}.{block}.second", between)])
        return x


def squares_last(channels):
    """Where the channels that ONNX makes of squares, pixel by pixel, are among ours, channel by channel."""
    of = channels // 4
    return [4 * c + pixel for pixel in range(4) for c in range(of)]


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    graph = Graph(load_file(sys.argv[1]))
    split = graph.constant("halves", np.array([3, 3], np.int64))
    graph.nodes.append(helper.make_node("Split", ["noisy", split], ["picture", "deviation"], axis=1))
    head = graph.weights["head.weight"].astype(np.float32)
    head = np.concatenate([head[:, squares_last(12)], head[:, 12:]], axis=1)
    noise = graph.add("AveragePool", ["deviation"], kernel_shape=[2, 2], strides=[2, 2])
    x = graph.add("Concat", [graph.squares("picture"), noise], axis=1)
    x = graph.add("Conv", [x, graph.constant("head", head)], kernel_shape=[3, 3], pads=[1] * 4)
    kept = []
    for level in range(LEVELS - 1):
        x = graph.blocks(f"down{level}", x)
        kept.append(x)
        x = graph.convolution(f"down{level}.scale", graph.squares(x), squares_in=True)
    x = graph.blocks("middle", x)
    for level in reversed(range(LEVELS - 1)):
        x = graph.add("Add", [graph.pixels(graph.convolution(f"up{level}.scale", x)), kept.pop()])
        x = graph.blocks(f"up{level}", x)
    x = graph.pixels(graph.convolution("tail", x))
    graph.nodes.append(helper.make_node("Add", ["picture", x], ["clean"]))
    sides = ["rows", "columns"]
    whole = helper.make_graph(
        graph.nodes,
        "denoiser",
        [helper.make_tensor_value_info("noisy", TensorProto.FLOAT, [1, 6, *sides])],
        [helper.make_tensor_value_info("clean", TensorProto.FLOAT, [1, 3, *sides])],
        graph.constants,
    )
    model = helper.make_model(whole, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    onnx.checker.check_model(model)
    onnx.save(model, sys.argv[2])


if __name__ == "__main__":
    main()
