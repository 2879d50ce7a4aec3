#!/usr/bin/env python3
"""Hold the licences and sources of all dependencies to the lists in deny.toml.

    python3 scripts/check_licences.py

Looks at the packages of Cargo.lock, of all features and platforms, as `cargo metadata` tells them. What `cargo deny check`
does as well; this needs nothing but cargo and Python 3.11. Exit code 0 if all are allowed, 1 if not.
"""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def allowed(expression: str, licences: set[str]) -> bool:
    """Whether an SPDX expression can be met by these licences; `/` is an `OR` of old."""
    tokens = re.findall(r"[()]|[^\s()/]+|/", expression)

    def either() -> bool:
        value = both()
        while tokens and tokens[0] in ("OR", "/"):
            tokens.pop(0)
            value = both() or value
        return value

    def both() -> bool:
        value = one()
        while tokens and tokens[0] == "AND":
            tokens.pop(0)
            value = one() and value
        return value

    def one() -> bool:
        token = tokens.pop(0)
        if token == "(":
            value = either()
            assert tokens.pop(0) == ")", expression
            return value
        if tokens[:1] == ["WITH"]:
            token = " ".join([token, tokens.pop(0), tokens.pop(0)])
        return token in licences

    value = either()
    assert not tokens, expression
    return value


def main() -> int:
    deny = tomllib.loads((ROOT / "deny.toml").read_text(encoding="utf-8"))
    licences = set(deny["licenses"]["allow"])
    registries = {f"registry+{url}" for url in deny["sources"]["allow-registry"]}
    command = ["cargo", "metadata", "--locked", "--all-features", "--format-version", "1", "--quiet"]
    packages = json.loads(subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout)["packages"]
    wrong = []
    for package in packages:
        name = f"{package['name']} {package['version']}"
        if not package["license"]:
            wrong.append(f"{name} states no licence: {package['repository'] or package['source']}")
        elif not allowed(package["license"], licences):
            wrong.append(f"{name} is under {package['license']}, which deny.toml does not allow")
        if package["source"] and package["source"] not in registries:
            wrong.append(f"{name} comes from {package['source']}, which deny.toml does not allow")
    print("\n".join(wrong) if wrong else f"{len(packages)} packages have licences and sources that deny.toml allows")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
