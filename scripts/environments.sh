#!/usr/bin/env bash
# The two environments of Python that .ci/run uses, made anew below target/ci: of its tools, and of the tests of the Python package.
set -euo pipefail
cd "$(dirname "$0")/.."
pip_of() { "$1/bin/pip" --disable-pip-version-check --quiet "${@:2}"; }

python3 -m venv target/ci
pip_of target/ci install -r scripts/requirements.txt -r scripts/site_requirements.txt

rm -rf target/ci/python/venv
mkdir -p target/ci/python
python3 -m venv target/ci/python/venv
pip_of target/ci/python/venv install -r scripts/requirements-python.txt
