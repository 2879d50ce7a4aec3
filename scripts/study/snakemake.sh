#!/usr/bin/env bash
# A study by Snakemake, with the same draws as a single process makes. Needs snakemake (9.x was tried).
# Usage: scripts/study/snakemake.sh [METALITH] [FOLDER]
set -euo pipefail
cd "$(dirname "$0")/../.."
metalith=$(realpath "${1:-target/release/metalith}")
folder=${2:-target/snakemake}
rm -rf "$folder"
mkdir -p "$folder"
sed "s#DESIGN#$PWD/designs/mini_3x3.toml#" scripts/study/tolerance.toml >"$folder/tolerance.toml"
snakemake --snakefile scripts/study/Snakefile --directory "$folder" --cores 2 --quiet all \
    --config metalith="$metalith" tolerance=tolerance.toml study=study draws_per_shard=2
"$metalith" study plan "$folder/tolerance.toml" --out "$folder/alone" --quiet
"$metalith" study run "$folder/alone" --missing --quiet
"$metalith" study merge "$folder/alone" --out "$folder/alone.csv" --psfs 0 --quiet
cmp "$folder/study/result.csv" "$folder/alone.csv" && echo "the draws are the same as those of one process"
