#!/usr/bin/env python3
"""The notebooks in python/examples, each made of the Python file of its name, whose cells begin with `# %%`.

    scripts/notebooks.py write     make them
    scripts/notebooks.py check     whether they are what their files say
    scripts/notebooks.py run       run all of them, as a person would, and say what each took

Files are what is written and what mypy reads; notebooks are what people open. Only `run` needs more than Python: nbclient,
nbformat, ipykernel.
"""

import json
import sys
from pathlib import Path

from cpu_time import children

EXAMPLES = Path(__file__).resolve().parents[1] / "python/examples"
NOTEBOOKS = ["lens_in_ten_lines", "foreign_layout", "calibration", "gradient", "picture"]

# All of them together (s of CPU): they take half of it alone on a machine, and more beside the tests.
MOST_CPU_S = 150.0


def cells(text: str) -> list[dict]:
    """The cells of a file: Markdown where the mark says so, else code."""
    found = []
    for part in ("\n" + text).split("\n# %%")[1:]:
        mark, _, body = part.partition("\n")
        body = body.strip("\n")
        if mark.strip() == "[markdown]":
            # A comment mark and one blank before each line.
            lines = [line.removeprefix("#").removeprefix(" ") for line in body.split("\n")]
            cell = {"cell_type": "markdown", "metadata": {}}
        else:
            lines = body.split("\n")
            cell = {"cell_type": "code", "execution_count": None, "metadata": {}, "outputs": []}
        ends = ["\n"] * (len(lines) - 1) + [""]
        source = [line + end for line, end in zip(lines, ends)]
        found.append({**cell, "id": f"cell-{len(found)}", "source": source})
    return found


def notebook(name: str) -> str:
    """The text of a notebook, without outputs."""
    metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    made = {
        "cells": cells((EXAMPLES / f"{name}.py").read_text()),
        "metadata": metadata,
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(made, indent=1, ensure_ascii=False) + "\n"


def run() -> None:
    import nbformat
    from nbclient import NotebookClient

    total = 0.0
    for name in NOTEBOOKS:
        before = children()
        content = nbformat.read(EXAMPLES / f"{name}.ipynb", as_version=4)
        # A kernel of this environment, whatever others are registered.
        client = NotebookClient(
            content,
            timeout=600,
            kernel_name="python3",
            resources={"metadata": {"path": EXAMPLES}},
            # It listens on this machine alone, and says so in a warning.
            extra_arguments=["--log-level=ERROR"],
        )
        client.execute()
        for cell in content.cells:
            for output in cell.get("outputs", []):
                if output.output_type == "stream":
                    print("   ", output.text.rstrip().replace("\n", "\n    "))
        took = children() - before
        total += took
        print(f"{name}: {took:.1f} CPU s")
    print(f"all: {total:.1f} CPU s")
    if total > MOST_CPU_S:
        sys.exit(f"the notebooks took {total:.1f} CPU s, {MOST_CPU_S:.0f} are the most")


def main() -> None:
    what = sys.argv[1] if len(sys.argv) == 2 else ""
    if what == "write":
        for name in NOTEBOOKS:
            (EXAMPLES / f"{name}.ipynb").write_text(notebook(name))
    elif what == "check":
        stale = [name for name in NOTEBOOKS if (EXAMPLES / f"{name}.ipynb").read_text() != notebook(name)]
        if stale:
            sys.exit(f"not what their files say: {', '.join(stale)}; make them with scripts/notebooks.py write")
    elif what == "run":
        run()
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
