#!/usr/bin/env bash
# The design rules of some layouts.
#
#     check.sh [OPTIONS of metalith check] -- LAYOUT...
#
# METALITH_SARIF and METALITH_JUNIT name folders for a report of each layout. The exit code is the largest of all layouts: 0 clean,
# 1 violations, 2 bad input, 3 a rule did not run.
set -uo pipefail

. "$(dirname "$0")/arguments.sh"

worst=0
for layout in "$@"; do
    reports=()
    name=${layout//[\/ ]/_}
    if [ -n "${METALITH_SARIF:-}" ]; then
        mkdir -p "$METALITH_SARIF" && reports+=(--sarif "$METALITH_SARIF/$name.sarif")
    fi
    if [ -n "${METALITH_JUNIT:-}" ]; then
        mkdir -p "$METALITH_JUNIT" && reports+=(--junit "$METALITH_JUNIT/$name.xml")
    fi
    metalith check --quiet ${options[@]+"${options[@]}"} ${reports[@]+"${reports[@]}"} "./$layout"
    code=$?
    [ "$code" -le "$worst" ] || worst=$code
done
exit "$worst"
