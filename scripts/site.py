"""The documentation as one static site: guides, methods, glossary, libraries in Rust and Python, and a gallery of results.

    python3 -m venv target/site/env && target/site/env/bin/pip install -r scripts/site_requirements.txt
    cargo doc --no-deps --workspace && cargo build --release
    target/site/env/bin/python scripts/site.py target/site

The site is in `target/site/html`. It works from a folder and from any server, and asks no other server
for anything; the search needs a server, such as `python -m http.server -d target/site/html`. What a page
links to is there: a broken link, or a page that no other page leads to, ends the command with exit code 1.
"""

import argparse
import html.parser
import importlib.util
import json
import re
import shutil
import subprocess
import sys
import time
import urllib.parse
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")

# Pages that commands of the program write: title, what it shows, command, and the page that this leaves below `out`.
GALLERY = [
    (
        "A lens",
        "Nine lenses of 60 um: verdict, Strehl ratio, focus, what was written and what was read back.",
        ["run", "designs/mini_3x3.toml"],
        "report.html",
    ),
    (
        "An array",
        "The full 3 x 3 array, 57.7 million pillars.",
        ["run", "designs/prototype_3x3.toml", "--fast"],
        "report.html",
    ),
    (
        "A hologram",
        "A phase that makes a picture, for 532 nm.",
        ["run", "designs/hologram.toml"],
        "report.html",
    ),
    (
        "Lenses of different kinds",
        "Round, square and hexagonal apertures and a cubic phase on one chip.",
        ["run", "designs/mixed_lenses.toml"],
        "report.html",
    ),
    (
        "Near infrared",
        "Round pillars of amorphous silicon on a hexagonal lattice, 1550 nm.",
        ["run", "designs/hexagonal_1550.toml"],
        "report.html",
    ),
    (
        "Long-wave infrared",
        "Round pillars of silicon on silicon, 10.6 um.",
        ["run", "designs/silicon_10600.toml"],
        "report.html",
    ),
    (
        "A lens of two polarisations",
        "Upright rectangles of titanium dioxide focus light of two polarisations at two places, 532 nm.",
        ["run", "designs/birefringent_532.toml"],
        "report.html",
    ),
    (
        "Rotated rectangles",
        "The geometric phase for circularly polarised light, 532 nm.",
        ["run", "designs/geometric_phase_532.toml"],
        "report.html",
    ),
    (
        "A lens of titanium dioxide",
        "Round pillars, 532 nm.",
        ["run", "designs/tio2_532.toml"],
        "report.html",
    ),
    (
        "An array of unequal spacing",
        "Two columns and four rows.",
        ["run", "designs/array_2x4.toml"],
        "report.html",
    ),
    (
        "A chip for a cleanroom",
        "The hand-off of a lens: dose matrix, test structures, rules, jobs.",
        ["handoff", "designs/hexagonal_1550.toml"],
        "index.html",
    ),
    (
        "A measured set",
        "A synthetic set in which pillars are 8 nm too narrow and the sensor is 5 um too far: which effects explain it.",
        ["calibrate", "golden/session", "--effects", "cd_bias,defocus,pixel_blur,zero_order"],
        "report.html",
    ),
]

# A picture takes ten CPU minutes to simulate, the first time.
PICTURE = (
    "A picture",
    "What the camera `true_light_sharp` records of a chart, and what is restored from it.",
    ["picture", "{out}/designs_true_light_sharp/true_light_sharp_pillars.gds", "chart", "--design", "designs/true_light_sharp.toml"]
    + ["--camera", "cameras/gt1930.toml", "--field-deg", "80", "--method", "tikhonov,prior"],
    "picture.html",
)

# Real measurements, which are not part of the repository: title, what it shows, description in `examples/measured`.
MEASURED = [
    ("A printed relief", "Heights by AFM beside the drawn ones (Zheng, Zhao, So, 2023): which effects explain them.", "relief"),
    ("A diamond film", "Reflectance over channels of known height (Stoffel and Janssens, 2026): thickness, index, roughness.", "spectra"),
]


def linked_files(start: Path) -> set[Path]:
    """All files of the repository that pages lead to, from a first page on."""
    found, left = set(), [start]
    while left:
        page = left.pop()
        if page in found:
            continue
        found.add(page)
        if page.suffix != ".md":
            continue
        for _, _, target in LINK.findall(without_code(page.read_text())):
            if re.match(r"[a-z]+:", target) or target.startswith("#"):
                continue
            path = (page.parent / target.split("#")[0]).resolve()
            if path.is_file() and path.is_relative_to(ROOT):
                left.append(path)
    return found


def without_code(text: str) -> str:
    """A page without its blocks of code, whose brackets are no links."""
    return re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)


def as_page(path: Path) -> str:
    """A page with links to folders as words: a site has no listings."""
    text = path.read_text()

    def link(found: re.Match) -> str:
        image, words, target = found.groups()
        if re.match(r"[a-z]+:", target) or target.startswith("#"):
            return found[0]
        folder = (path.parent / target.split("#")[0]).resolve()
        return found[0] if image or not folder.is_dir() else words

    # Odd parts are blocks of code.
    parts = re.split(r"(^```.*?^```)", text, flags=re.S | re.M)
    return "".join(part if k % 2 else LINK.sub(link, part) for k, part in enumerate(parts))


def picture(metalith: Path, out: Path) -> tuple:
    """The picture of the gallery, whose layout is written before."""
    title, words, command, page = PICTURE
    design = command[command.index("--design") + 1]
    folder = out / design.replace("/", "_").removesuffix(".toml")
    subprocess.run([metalith, "layout", design, "--out", folder, "--quiet"], cwd=ROOT, check=True)
    return title, words, [part.format(out=out) for part in command], page


def measured(data: Path, out: Path) -> list:
    """Measured sets of the gallery: each with its description from `examples/measured` and its folder below `data`."""
    results = []
    for title, words, name in MEASURED:
        text = (ROOT / f"examples/measured/{name}.toml").read_text()
        # Keys of the top level stand before the first section.
        head, section, rest = text.partition("\n[")
        out.mkdir(parents=True, exist_ok=True)
        file = out / f"{name}.toml"
        file.write_text(f'{head}\nfolder = "{data.resolve() / name}"\n{section}{rest}')
        results.append((title, words, ["calibrate", str(file)], "report.html"))
    return results


def gallery(results: list, metalith: Path, out: Path, source: Path) -> None:
    """Pages of results, made by the program, and a page that leads to them."""
    lines = ["# Gallery", "", "Each page was written by the command above it. It holds its pictures and needs no other file.", ""]
    for title, words, command, page in results:
        # Files that were written before are in the folder of this machine.
        said = ["out/" + Path(part).name if part.startswith(str(out)) else part for part in command]
        folder = out / "_".join([command[0], Path(command[1]).stem])
        began = time.monotonic()
        subprocess.run([metalith, *command, "--out", folder, "--quiet"], cwd=ROOT, check=True)
        print(f"{title}: {time.monotonic() - began:.0f} s", flush=True)
        name = f"{folder.name}.html"
        (source / "gallery").mkdir(exist_ok=True)
        shutil.copy(folder / page, source / "gallery" / name)
        lines += [f"## {title}", "", words, "", "```", " ".join(["metalith", *said]), "```", ""]
        lines += [f"[Open the page](gallery/{name})", ""]
    (source / "gallery.md").write_text("\n".join(lines))


def nav(pages: set[str]) -> list:
    """Order of the pages, and their titles."""
    guide = ["design", "layout", "verify", "cells", "optimise", "check", "handoff", "plan", "calibrate", "measure", "picture", "study", "python"]
    title = lambda page: (ROOT / page).read_text().lstrip().splitlines()[0].lstrip("# ").strip()
    of = lambda folder: sorted(p for p in pages if p.startswith(folder))
    guides = [p for p in (f"docs/guide/{name}.md" for name in guide) if p in pages]
    guides += [p for p in of("docs/guide/") if p not in guides]
    known = {"README.md", "docs/README.md", "docs/glossary.md", *guides, *of("docs/method/")}
    more = sorted(pages - known)
    return [
        {"Start": "README.md"},
        {"Guides": ["docs/README.md", *({title(p): p} for p in guides)]},
        {"Methods": [{title(p): p} for p in of("docs/method/")]},
        {"Glossary": "docs/glossary.md"},
        {"Gallery": "gallery.md"},
        {"Libraries": "libraries.md"},
        {"More": [{title(p): p} for p in more]},
    ]


def libraries(source: Path, html_folder: Path, doc: Path) -> None:
    """The documentation of the libraries in Rust and Python, and a page that leads to it."""
    lines = ["# Libraries", ""]
    if doc.is_dir():
        shutil.copytree(doc, html_folder / "rust", dirs_exist_ok=True)
        lines += ["## Rust", "", "Crates that can be used alone come first.", ""]
        names = sorted(p.parent.name for p in doc.glob("metalith*/index.html"))
        alone = ["metalith_oasis", "metalith_gds", "metalith_rcwa", "metalith_wave"]
        for name in [n for n in alone if n in names] + [n for n in names if n not in alone]:
            lines.append(f"- <a href=\"rust/{name}/index.html\">{name}</a>")
        lines.append("")
    if importlib.util.find_spec("metalith"):
        subprocess.run([sys.executable, "-m", "pdoc", "metalith", "-o", html_folder / "python"], check=True)
        lines += ["## Python", "", '- <a href="python/metalith.html">metalith</a>', ""]
    if len(lines) == 2:
        lines.append("They were not made when this site was built: see `scripts/site.py`.")
    (source / "libraries.md").write_text("\n".join(lines) + "\n")


class Links(html.parser.HTMLParser):
    """Links and anchors of a page, and what it would ask of other servers."""

    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.requests: list[str] = []

    def handle_starttag(self, tag: str, attrs: list) -> None:
        values = dict(attrs)
        self.anchors |= {values[k] for k in ("id", "name") if values.get(k)}
        if tag == "a" and values.get("href"):
            self.links.append(values["href"])
        loads = values.get("src") or (values.get("href") if tag == "link" else None)
        if loads and re.match(r"(https?:)?//", loads):
            self.requests.append(loads)


def faults(site: Path) -> list[str]:
    """Links that lead nowhere, and what pages ask of other servers."""
    pages = {}
    for path in site.rglob("*.html"):
        # Rustdoc checks its own links.
        if not path.is_relative_to(site / "rust"):
            pages[path] = Links()
            pages[path].feed(path.read_text())
    found = []
    for path, page in pages.items():
        found += [f"{path.relative_to(site)}: asks another server: {request}" for request in page.requests]
        for link in page.links:
            parts = urllib.parse.urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            there = pages.get(target)
            if not target.exists():
                found.append(f"{path.relative_to(site)}: leads nowhere: {link}")
            elif parts.fragment and there and parts.fragment not in there.anchors:
                found.append(f"{path.relative_to(site)}: no such place in the page: {link}")
    return sorted(set(found))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder of the site")
    parser.add_argument("--metalith", type=Path, default=ROOT / "target/release/metalith", help="the program, for the gallery")
    parser.add_argument("--doc", type=Path, default=ROOT / "target/doc", help="output of `cargo doc`")
    parser.add_argument("--no-gallery", action="store_true", help="leave the gallery out, which takes half an hour of CPU time")
    parser.add_argument("--measured", type=Path, help="folder with `relief` and `spectra`: data of the sources that `examples/measured` names")
    given = parser.parse_args()
    out = given.out.resolve()
    source, site = out / "source", out / "html"
    for folder in (source, site):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
    files = linked_files(ROOT / "README.md") | linked_files(ROOT / "CHANGELOG.md")
    for path in sorted(files):
        to = source / path.relative_to(ROOT)
        to.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".md":
            to.write_text(as_page(path))
        else:
            shutil.copy(path, to)
    shutil.copy(ROOT / "scripts/site.css", source)
    metalith, made = given.metalith.resolve(), out / "gallery"
    results = [] if given.no_gallery else [*GALLERY, picture(metalith, made)]
    if given.measured:
        results += measured(given.measured, made)
    gallery(results, metalith, made, source)
    libraries(source, site, given.doc)
    pages = {str(p.relative_to(ROOT)) for p in files if p.suffix == ".md"}
    settings = {
        "site_name": "metalith",
        "docs_dir": str(source),
        "site_dir": str(site),
        # Pages open from a folder too.
        "use_directory_urls": False,
        "theme": {
            "name": "mkdocs",
            "color_mode": "auto",
            "user_color_mode_toggle": True,
            "highlightjs": False,
            "nav_style": "dark",
        },
        "markdown_extensions": ["tables", "fenced_code", {"toc": {"permalink": False}}],
        "extra_css": ["site.css"],
        "plugins": ["search"],
        "nav": nav(pages),
        "validation": {"links": {"anchors": "warn", "unrecognized_links": "ignore"}},
    }
    (out / "mkdocs.yml").write_text(json.dumps(settings, indent=1))
    # Without --clean: the libraries are there already.
    subprocess.run([sys.executable, "-m", "mkdocs", "build", "--quiet", "--dirty", "-f", out / "mkdocs.yml"], check=True)
    for page in site.rglob("*.html"):
        # What scrolls must be within reach of a keyboard.
        if not page.is_relative_to(site / "rust") and page.parent.name != "gallery":
            text = re.sub(r"<(pre|table)>", r'<\1 tabindex="0">', page.read_text())
            # The script of the theme switches two styles of code that a site without them does not have.
            page.write_text(text.replace("</head>", '<style id="hljs-light"></style><style id="hljs-dark"></style></head>'))
    # Its links are those of a site at the root of a server.
    (site / "404.html").unlink()
    wrong = faults(site)
    print(*wrong, sep="\n", end="\n" if wrong else "")
    print(f"{len(list(site.rglob('*.html')))} pages: {site / 'index.html'}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
