#!/bin/sh
# Solve the tables of unlike neighbours that the 3 x 3 designs of the repository need, and put them where the program is
# built with them. To be run when the supercells, their fit, the cell or a mapping of these designs change; 20 CPU min.
#
#     scripts/ship_tables.sh [METALITH]
set -eu
cd "$(dirname "$0")/.."
metalith=${1:-target/release/metalith}
tables=crates/cell/tables
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$tables" "$work/cache"
# Those that came with this program and are still of use are found there, and not solved again.
for design in mini_3x3 prototype_3x3 neighbours_3x3; do
    METALITH_CACHE="$work/cache" "$metalith" run "designs/$design.toml" --fidelity neighbours --fast \
        --out "$work/$design"
done
cp "$work"/cache/neighbours-*.bin "$tables"
# Cargo does not see by itself that the tables have changed.
touch crates/cell/src/coupled/shipped.rs
