#!/usr/bin/env bash
# The work of action.yml: `metalith check` and `metalith diff` for the layouts of a repository.
#
# METALITH_LAYOUTS     patterns of layouts, separated by white space
# METALITH_OPTIONS     options of `metalith check`, separated by white space
# METALITH_BASE        commit to compare with; nothing is compared if it is empty
# METALITH_DIFFERENT   `fail` or `report`: what a different geometry does
# METALITH_SARIF, METALITH_JUNIT, METALITH_DIFF: folders of the reports
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)

# Patterns are for Git: files of the repository, and no others.
mapfile -t layouts < <(printf '%s' "${METALITH_LAYOUTS:?patterns of layouts}" | xargs -r git ls-files --)
[ ${#layouts[@]} -gt 0 ] || { echo "action.sh: no file of the repository is named by: $METALITH_LAYOUTS" >&2; exit 2; }
read -r -a options <<<"${METALITH_OPTIONS:-}"

"$here/check.sh" ${options[@]+"${options[@]}"} -- "${layouts[@]}"
worst=$?
if [ -n "${METALITH_BASE:-}" ]; then
    "$here/diff.sh" -- "${layouts[@]}"
    code=$?
    [ "$code" -ne 1 ] || [ "${METALITH_DIFFERENT:-report}" = fail ] || code=0
    [ "$code" -le "$worst" ] || worst=$code
fi
exit "$worst"
