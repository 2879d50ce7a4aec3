#!/usr/bin/env bash
# Layouts, rules and light of the shipped designs beside KLayout and gdstk, in the environment of scripts/environments.sh.
# Usage: scripts/compare_programs.sh METALITH [weekly]; weekly prints what readers and writers take, too.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/step.sh
metalith=${1:?give the program}
tier=${2:-full}

step "layouts against KLayout and gdstk"
# What readers and writers take beside ours is printed in the weekly tier.
times=$([ "$tier" = weekly ] && echo --times || true)
# shellcheck disable=SC2086
target/ci/bin/python scripts/compare_layouts.py "$metalith" target/ci/layouts $times

step "lenses drawn with gdstk have the PSFs of the same lenses written by metalith"
target/ci/bin/python scripts/compare_drawn.py "$metalith" target/ci/drawn

step "design rules against KLayout"
target/ci/bin/python scripts/compare_klayout_drc.py "$metalith" target/ci/rules

step "the shipped designs: rules hold, geometry is that of the golden file"
# Results of another program in these folders would be refused.
rm -rf target/ci/shipped
for design in mini_3x3 prototype_3x3; do
    out=target/ci/shipped/$design
    "$metalith" layout "designs/$design.toml" --out "$out" --quiet
    "$metalith" check "$out/${design}_pillars.gds" --design "designs/$design.toml" --quiet >"$out/check.txt" ||
        { cat "$out/check.txt"; exit 1; }
    "$metalith" check "$out/${design}_apertures.gds" --rules rules/sin_apertures.toml --design "designs/$design.toml" \
        --with "$out/${design}_pillars.gds" --quiet >"$out/check_apertures.txt" ||
        { cat "$out/check_apertures.txt"; exit 1; }
    tail -n 1 "$out/check.txt" "$out/check_apertures.txt"
done
gunzip -c golden/mini_3x3/flat.gds.gz >target/ci/shipped/golden.gds
"$metalith" diff target/ci/shipped/golden.gds target/ci/shipped/mini_3x3/mini_3x3_pillars.gds

step "designs of other cells, arrays and phases: written, read back, simulated, rules, the same in both formats"
for design in asi_940 tio2_532 silicon_10600 hologram array_2x4 mixed_lenses geometric_phase_532 birefringent_532; do
    out=target/ci/shipped/$design
    "$metalith" run "designs/$design.toml" --out "$out" --quiet
    # Squares, of which a design says nothing, have the rules that are taken where none are named.
    case $(sed -n 's/^shape = "\([a-z_]*\)".*/\1/p' "designs/$design.toml") in
    circle) shapes=circles rules="--rules rules/circles.toml" size= ;;
    rectangle) shapes=rectangles rules="--rules rules/rectangles.toml" size="100 250 1" ;;
    upright_rectangle) shapes=rectangles rules="--rules rules/rectangles.toml" size="upright 90 10 20" ;;
    *) shapes='' rules='' size='' ;;
    esac
    # shellcheck disable=SC2086
    "$metalith" check "$out/${design}_pillars.gds" $rules --design "designs/$design.toml" --quiet >"$out/check.txt" ||
        { cat "$out/check.txt"; exit 1; }
    tail -n 1 "$out/check.txt"
    "$metalith" convert "$out/${design}_pillars.gds" "$out/${design}_pillars.oas" --quiet
    "$metalith" diff "$out/${design}_pillars.gds" "$out/${design}_pillars.oas" --quiet
    "$metalith" layout "designs/$design.toml" --hierarchy flat --out "$out/flat" --quiet
    target/ci/bin/python scripts/compare_xor.py "$out/${design}_pillars.gds" "$out/flat/${design}_pillars.gds" "$out/${design}_pillars.oas"
    if [ -n "$shapes" ]; then
        # shellcheck disable=SC2086
        target/ci/bin/python "scripts/compare_$shapes.py" "$out/${design}_pillars.gds" "$out/${design}_pillars.oas" $size
    fi
done

step "a hexagonal lattice: written in both formats, read back, simulated, rules, the same geometry, in KLayout too"
out=target/ci/shipped/hexagonal_1550
"$metalith" run designs/hexagonal_1550.toml --out "$out" --quiet
"$metalith" check "$out/hexagonal_1550_pillars.gds" --rules rules/circles.toml --design designs/hexagonal_1550.toml --quiet \
    >"$out/check.txt" || { cat "$out/check.txt"; exit 1; }
tail -n 1 "$out/check.txt"
"$metalith" layout designs/hexagonal_1550.toml --out "$out" --format oasis --quiet
"$metalith" diff "$out/hexagonal_1550_pillars.gds" "$out/hexagonal_1550_pillars.oas" --quiet
target/ci/bin/python scripts/compare_circles.py "$out/hexagonal_1550_pillars.gds" "$out/hexagonal_1550_pillars.oas"
"$metalith" layout designs/hexagonal_1550.toml --hierarchy flat --out "$out/flat" --quiet
target/ci/bin/python scripts/compare_xor.py "$out/hexagonal_1550_pillars.gds" "$out/flat/hexagonal_1550_pillars.gds" "$out/hexagonal_1550_pillars.oas"

"$metalith" handoff designs/hexagonal_1550.toml --out target/ci/shipped/hexagonal_handoff --quiet

step "layouts that KLayout and gdstk saved again: what they hold, differences, rules and light as of the original"
target/ci/bin/python scripts/compare_resaved.py "$metalith" target/ci/resaved designs/mini_3x3.toml designs/silicon_10600.toml
