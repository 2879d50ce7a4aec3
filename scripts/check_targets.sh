#!/usr/bin/env bash
# Compile all crates and the Python package for the systems that this one is not: what only one system has stands behind `cfg`.
#
#     scripts/check_targets.sh [TARGET...]   targets of rustup that are installed; those of the list below if left out
#
# `cargo check` links nothing: no linker and no libraries of the other systems are needed. The build script of `psm`, which `npyz`
# brings, assembles a file; it gets a compiler that writes an empty object. Takes some 3 CPU minutes a target and 2 GB of disk,
# which are given back. A target that is not installed is named and left out. Fails if one does not compile.
set -euo pipefail
cd "$(dirname "$0")/.."
export CARGO_INCREMENTAL=0
[ $# -gt 0 ] || set -- x86_64-pc-windows-gnu x86_64-pc-windows-msvc aarch64-apple-darwin x86_64-apple-darwin aarch64-unknown-linux-gnu

work=target/targets
trap 'rm -rf "$work"' EXIT
mkdir -p "$work"
# The options that name an output are those of compilers and of `lib.exe`.
cat >"$work/no_compiler" <<'SCRIPT'
#!/bin/sh
for option; do
    case $previous in -o) : >"$option" ;; esac
    case $option in -Fo*) : >"${option#-Fo}" ;; esac
    previous=$option
done
SCRIPT
chmod +x "$work/no_compiler"

installed=$(rustup target list --installed)
for target; do
    if ! grep -qx "$target" <<<"$installed"; then
        echo "$target is NOT checked: rustup target add $target"
        continue
    fi
    variable=${target//-/_}
    env "CC_$variable=$PWD/$work/no_compiler" "AR_$variable=ar" \
        cargo check --quiet --locked --workspace --target "$target" --target-dir "$work"
    echo "$target compiles"
done
