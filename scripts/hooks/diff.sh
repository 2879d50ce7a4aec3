#!/usr/bin/env bash
# The geometry of some layouts of a Git repository, compared with that of a commit.
#
#     diff.sh [OPTIONS of metalith diff] -- LAYOUT...
#
# METALITH_BASE names the commit; HEAD if it is not set. A layout that the commit does not have is new, and passes. METALITH_DIFF
# names a folder for a page of each difference. The exit code is the largest of all layouts: 0 same geometry, 1 different, 2 bad input.
set -uo pipefail

. "$(dirname "$0")/arguments.sh"

base=${METALITH_BASE:-HEAD}
git rev-parse --quiet --verify "$base^{commit}" >/dev/null || { echo "diff.sh: there is no commit $base" >&2; exit 2; }
before=$(mktemp -d)
trap 'rm -rf "$before"' EXIT

worst=0
for layout in "$@"; do
    if ! git cat-file -e "$base:./$layout" 2>/dev/null; then
        echo "$layout: new since $base"
        continue
    fi
    # Where Git holds a pointer to a large file (LFS), the filter gives the file itself.
    old=$before/$(basename "$layout")
    git cat-file --filters "$base:./$layout" >"$old" || exit 2
    reports=()
    if [ -n "${METALITH_DIFF:-}" ]; then
        mkdir -p "$METALITH_DIFF" && reports+=(--report "$METALITH_DIFF/${layout//[\/ ]/_}.html")
    fi
    echo "$layout: $base and now"
    metalith diff --quiet ${options[@]+"${options[@]}"} ${reports[@]+"${reports[@]}"} "$old" "./$layout"
    code=$?
    [ "$code" -le "$worst" ] || worst=$code
done
exit "$worst"
