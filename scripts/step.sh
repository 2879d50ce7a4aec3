# shellcheck shell=bash
# Sourced by .ci/run and by what it calls: the title of a step, and when it begins in the whole run.
export STEPS_BEGIN=${STEPS_BEGIN:-$(date +%s)}
step() {
    local s=$(($(date +%s) - STEPS_BEGIN))
    printf '\n== %s (at %d min %02d s)\n' "$*" $((s / 60)) $((s % 60))
}
