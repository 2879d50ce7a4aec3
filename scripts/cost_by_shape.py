"""CPU time of layouts, rules and differences by the shape of pillars: `cost_by_shape.py METALITH FOLDER`.

Lenses of 1 mm: `designs/tio2_532.toml` as squares and as it is, of circles, `designs/geometric_phase_532.toml`, of rotated
rectangles, and `designs/birefringent_532.toml`, of upright ones. Folded by symmetry (squares and circles eightfold, rectangles twofold), as one cell for each
size and rotation, and, but for circles, flat: one outline for each pillar.
"""

import pathlib
import re
import shutil
import subprocess
import sys

from cpu_time import children

ROOT = pathlib.Path(__file__).parent.parent
RUNS = 3
SHAPES = {"squares": "tio2_532", "circles": "tio2_532", "rectangles": "geometric_phase_532", "upright": "birefringent_532"}


def design_of(shape, folder):
    """A lens of 1 mm of this shape: the file of its design."""
    text = (ROOT / "designs" / f"{SHAPES[shape]}.toml").read_text()
    for key, value in {
        "diameter_um": "1000",
        "spacing_um": "1200",
        "size_um": "[1300, 1300]",
        "chord_error_nm": "70",
    }.items():
        text = re.sub(rf"^{key} = .*", f"{key} = {value}", text, flags=re.M)
    if shape == "squares":
        text = text.replace('shape = "circle"', 'shape = "square"')
    for files in ("mappings", "phases"):
        text = text.replace(f'"{files}/', f'"{ROOT}/designs/{files}/')
    file = folder / f"{shape}.toml"
    file.write_text(text)
    return file


def cpu_s(*command):
    """Least CPU time of some runs; findings are no failure here."""
    times = []
    for _ in range(RUNS):
        before = children()
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True)
        assert done.returncode in (0, 1), command
        times.append(children() - before)
    return min(times)


def main(metalith, folder):
    folder.mkdir(parents=True, exist_ok=True)
    print(f"{'us a pillar':24}{'layout':>8}{'diff':>8}{'check':>8}")
    for hierarchy in ("folded", "sref", "flat"):
        for shape in SHAPES:
            if hierarchy == "flat" and shape == "circles":
                continue
            design, out = design_of(shape, folder), folder / "out"
            make = [metalith, "layout", str(design), "--hierarchy", hierarchy, "--out", str(out)]
            said = subprocess.run(make, check=True, stdout=subprocess.PIPE, text=True).stdout
            pillars = int(re.search(r"(\d+) pillars in", said)[1])
            written = cpu_s(*make, "--quiet")
            layout, other = folder / f"{shape}.gds", folder / f"{shape}.oas"
            shutil.move(next(out.glob("*_pillars.gds")), layout)
            subprocess.run([metalith, "convert", str(layout), str(other), "--quiet"], check=True)
            checked = cpu_s(metalith, "check", str(layout), "--design", str(design), "--quiet")
            compared = cpu_s(metalith, "diff", str(layout), str(other), "--quiet")
            each = [1e6 * s / pillars for s in (written, compared, checked)]
            print(f"{shape + ', ' + hierarchy:24}" + "".join(f"{us:8.3f}" for us in each))
            layout.unlink()
            other.unlink()


if __name__ == "__main__":
    main(sys.argv[1], pathlib.Path(sys.argv[2]))
