#!/usr/bin/env bash
# An archive of the program: program, licence, manual pages, completions, schemas.
#
#     packaging/archive.sh FOLDER_OF_THE_PROGRAM OUT TARGET
#
# The archive has the name and the inner folder that `cargo binstall` expects: see [package.metadata.binstall] in Cargo.toml.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
built=$1 out=$2 target=$3

suffix=''
[ ! -e "$built/metalith.exe" ] || suffix=.exe
program=$built/metalith$suffix
version=$("$program" --version | cut -d ' ' -f 2)
name=metalith-$version-$target
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
inner=$work/$name
mkdir -p "$inner/man" "$inner/completions" "$inner/schemas" "$out"

cp "$program" "$inner/metalith$suffix"
cp "$root/LICENSE" "$root/README.md" "$root/CHANGELOG.md" "$inner/"
"$program" manual "$inner/man" >/dev/null
for shell in bash zsh fish elvish powershell; do
    "$program" completions "$shell" >"$inner/completions/metalith.$shell"
done
for kind in $("$program" schema --list); do
    "$program" schema "$kind" >"$inner/schemas/$kind.schema.json"
done
tar -C "$work" -czf "$out/$name.tar.gz" "$name"
echo "$out/$name.tar.gz"
