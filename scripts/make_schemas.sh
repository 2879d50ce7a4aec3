#!/usr/bin/env bash
# The schemas in schemas/ as the readers have their keys now.
#
#     scripts/make_schemas.sh PROGRAM            write them
#     scripts/make_schemas.sh PROGRAM --compare  fail if one of them differs
set -euo pipefail
program=$(realpath "$1")
cd "$(dirname "$0")/.."

differing=0
for kind in $("$program" schema --list); do
    file=schemas/$kind.schema.json
    if [ "${2:-}" = --compare ]; then
        "$program" schema "$kind" --of-readers | cmp - "$file" || differing=1
    else
        "$program" schema "$kind" --of-readers >"$file.new" && mv "$file.new" "$file"
    fi
done
[ "$differing" = 0 ] || { echo "readers have other keys than schemas/: run scripts/make_schemas.sh $1" >&2; exit 1; }
