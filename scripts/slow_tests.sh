#!/usr/bin/env bash
# Tests that .ci/run has no time for, and .ci/run weekly runs: all ignored tests but those of .ci/run (scripts/check_ignored.py
# names them), and networks in ONNX. Among them tables of neighbours against the truth, a frame of the camera against a direct
# sum, pictures for learnt last stages. To be run when crates of cells, fields, chips as fabricated, pictures or calibrations
# change; some 33 CPU minutes, 13 of them for the direct sums. METALITH_ALL_ROWS=1 compares all rows of the truth, which takes
# an hour more. Options are those of the test programs, such as --nocapture or a name.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo test --release --locked -p metalith-prior --features onnx --lib onnx
others=$(python3 scripts/check_ignored.py --weekly)
# shellcheck disable=SC2086
cargo test --release --locked --tests -- --ignored $others "$@"
