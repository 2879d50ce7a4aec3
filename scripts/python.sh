#!/usr/bin/env bash
# The Python package as a user gets it: installed into a fresh environment, its types checked, its tests, notebooks and examples run.
# Usage: scripts/environments.sh, then scripts/python.sh.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/step.sh
folder=$(realpath target/ci/python)
step "the Python package: installed, types checked, tests and examples, a study on a Dask cluster"

# The tests of the workspace have compiled most of the wheel.
MATURIN_PEP517_ARGS="--features as-tested" "$folder/venv/bin/pip" --disable-pip-version-check --quiet install ./python
"$folder/venv/bin/mypy" --strict --cache-dir "$folder/mypy" python/examples python/tests
"$folder/venv/bin/pyright" --project python --pythonpath "$folder/venv/bin/python"
python3 scripts/notebooks.py check
# The tests leave half of two cores idle; what notebooks may cost is CPU time.
"$folder/venv/bin/python" scripts/notebooks.py run >"$folder/notebooks.txt" 2>&1 &
notebooks=$!
trap 'kill "$notebooks" 2>/dev/null || true' EXIT
"$folder/venv/bin/python" -m pytest -q -p no:cacheprovider python/tests
wait "$notebooks" || { cat "$folder/notebooks.txt"; exit 1; }
cat "$folder/notebooks.txt"
for example in tolerances gdsfactory_chip; do
    echo "== $example"
    "$folder/venv/bin/python" "python/examples/$example.py"
done
