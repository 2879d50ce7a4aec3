#!/usr/bin/env bash
# Tests of the second tier that .ci/run has no time for: every effect through every command, tables of neighbours
# against the truth, a frame of the camera against a direct sum, pictures for learnt last stages, networks in ONNX. To be run when crates cell, rcwa,
# wave, optics, imaging, restoration, baselines or calibrate change; some 34 CPU minutes, 13 of them for the direct sums. METALITH_ALL_ROWS=1 compares all rows of the truth, which takes an hour more.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo test --release -p metalith-prior --features onnx --lib onnx
cargo test --release -p metalith-baselines -p metalith-calibrate -p metalith-optics --lib -- --ignored "$@"
cargo test --release --test program --test table --test neighbours --test forward --test stray_light --test rectangles -- --ignored "$@"
