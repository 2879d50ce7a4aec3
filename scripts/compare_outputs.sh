#!/usr/bin/env bash
# Prove that a change of the sources changed no output: run two programs, OLD and NEW, in folders of their own, and compare.
# Prints one line for each comparison that differs and a count; exit code 0 if all are equal, 1 if not, 2 if it could not be done.
#
#     scripts/compare_outputs.sh OLD NEW [--slow] [--only WORD,WORD] [--old-files COMMIT] [--fresh] [--list]
#
# --slow adds what takes minutes: full-size layouts that are not folded, the diagnosis of golden/session, the kernels of a picture.
# --only keeps the tasks whose names hold one of the words; --list prints the names.
# --old-files COMMIT gives OLD the cameras, studies and golden files of that commit, where the keys of such files changed since.
# What a program wrote is kept in target/compare_outputs, so that OLD is run once; --fresh runs it again.
set -euo pipefail
exec python3 "$(dirname "$0")/outputs/main.py" "$@"
