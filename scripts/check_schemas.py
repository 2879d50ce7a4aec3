#!/usr/bin/env python3
"""The schemas that the program prints, held against the files of the repository by an independent validator.

    scripts/check_schemas.py PROGRAM

Every key has a meaning. Every shipped file is valid. A file with an unknown key, and one with a number beyond its limit, are not. Every number has limits or a
reason not to have any, and every literal key that a reader asks for is in a schema.
"""

import json
import pathlib
import re
import subprocess
import sys
import tomllib

import jsonschema

ROOT = pathlib.Path(__file__).resolve().parent.parent

# Files by the kind of their schema.
FILES = {
    "design": ["designs/*.toml"],
    "camera": ["cameras/*.toml"],
    "rules": ["rules/*.toml"],
    "process": ["processes/*.toml"],
    "study": ["scripts/study/*.toml"],
    "set": ["golden/session/measurement.toml"],
    "set-heights": ["examples/measured/relief.toml"],
    "set-spectra": ["examples/measured/spectra.toml", "examples/measured/pads.toml"],
    "set-widths": ["examples/measured/widths.toml"],
    "set-psf-stack": ["examples/measured/mask_stack.toml"],
    "effects": ["golden/shapes.toml", "golden/ghost.toml"],
}

# A getter of a section with a literal key.
GETTER = re.compile(
    r"\.(?:float|float_or|optional_float|integer|integer_or|optional_integer|text|text_or|optional_text|texts|choice"
    r"|optional_choice_or_float|floats|scalars|array|optional_array|file|optional_file|file_else|contents|path"
    r"|section|section_or_none|optional_section|sections)(?:::<[^>]*>)?\(\s*\"([a-z_0-9]+)\""
)

# Crates whose readers have schemas.
READERS = "design sensor drc handoff study bench-plan calibrate metrology attribution".split()


def keys(schema, found):
    """The names of all keys of a schema."""
    for name, inner in schema.get("properties", {}).items():
        found.add(name)
        keys(inner, found)
    for inner in schema.get("anyOf", []):
        keys(inner, found)
    for below in ("items", "additionalProperties"):
        if isinstance(schema.get(below), dict):
            keys(schema[below], found)
    return found


# Asked for by a reader that refuses it, so that no guide has it.
NO_MEANING = {"set-psf-stack: layout"}


def without_meaning(schema, path, found):
    """Paths of the keys that have no words for people."""
    for name, inner in schema.get("properties", {}).items():
        if not inner.get("description"):
            found.append(".".join((*path, name)))
        without_meaning(inner, (*path, name), found)
    for inner in schema.get("anyOf", []):
        without_meaning(inner, path, found)
    for below in ("items", "additionalProperties"):
        if isinstance(schema.get(below), dict):
            without_meaning(schema[below], path, found)
    return found


def limits(schema, path, found):
    """The first number with a largest value below each path."""
    for name, inner in schema.get("properties", {}).items():
        if "maximum" in inner:
            found.append((*path, name, inner["maximum"]))
        elif inner.get("type") == "object":
            limits(inner, (*path, name), found)
    return found


def main():
    program = sys.argv[1]
    run = lambda *options: subprocess.run([program, "schema", *options], check=True, capture_output=True, text=True).stdout
    schemas = {kind: json.loads(run(kind)) for kind in run("--list").split()}
    faults, checked = [], 0
    known = set()
    for kind, schema in schemas.items():
        jsonschema.Draft7Validator.check_schema(schema)
        keys(schema, known)
        silent = {f"{kind}: {path}" for path in without_meaning(schema, (), [])} - NO_MEANING
        faults += [f"{key} has no meaning: add it to a table of keys in the guide" for key in sorted(silent)]
        validator = jsonschema.Draft7Validator(schema)
        for pattern in FILES.get(kind, []):
            paths = sorted(ROOT.glob(pattern))
            if not paths:
                faults.append(f"{pattern}: no such file")
            for path in paths:
                text = tomllib.loads(path.read_text())
                checked += 1
                name = path.relative_to(ROOT)
                faults += [f"{name}: {'.'.join(map(str, e.absolute_path))}: {e.message}" for e in validator.iter_errors(text)]
                if validator.is_valid({**text, "unknown_key": 1}):
                    faults.append(f"{name}: an unknown key is valid")
                for *section, key, most in limits(schema, (), []):
                    table = text
                    for part in section:
                        table = table.get(part, {})
                    if key in table and isinstance(table[key], (int, float)):
                        before, table[key] = table[key], most * 1.001 + 1
                        if validator.is_valid(text):
                            faults.append(f"{name}: {key} = {table[key]} is valid, and its limit is {most}")
                        table[key] = before
    for crate in READERS:
        for path in sorted((ROOT / "crates" / crate / "src").rglob("*.rs")):
            source = re.split(r"#\[cfg\((?:all\()?test", path.read_text())[0]
            for key in set(GETTER.findall(source)) - known:
                faults.append(f"{path.relative_to(ROOT)}: no schema has the key `{key}`")
    print(*faults, sep="\n")
    print(f"{len(schemas)} schemas, {len(known)} names of keys, {checked} files, {len(faults)} faults")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
