#!/usr/bin/env bash
# Everything beside what a user would pick instead, in one go on this machine: layouts written and read, one PSF, a
# lens optimised by gradients, one point of the cell. Installs the peers into target/peers (some 2 GB) and takes a quarter of an hour.
# Usage: scripts/peers.sh
set -euo pipefail
cd "$(dirname "$0")/.."

cargo build --release --locked --bins --examples
python3 -m venv target/peers
target/peers/bin/pip install --quiet --disable-pip-version-check -r scripts/requirements.txt \
    scipy torchoptics diffractio grcwa meent fmmax ./python
python=target/peers/bin/python

step() { printf '\n== %s\n' "$*"; }

step layouts
"$python" scripts/peers_layout.py target/release/metalith target/peers/layouts
step "reading pillars into arrays"
"$python" scripts/time_readers.py
step "one PSF"
"$python" scripts/diffraction_peers.py
step "a lens out of noise"
"$python" scripts/gradient_peers.py
step "one point of the cell"
"$python" scripts/rcwa_peers.py
