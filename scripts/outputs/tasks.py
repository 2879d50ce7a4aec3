"""What both programs are asked to do, and what of the answer is compared."""

import gzip
import hashlib
import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import forms
from program import Program

ROOT = Path(__file__).resolve().parents[2]
HIERARCHIES = ["folded", "sref", "flat"]
FORMATS = {
    "gds": ["--format", "gds"],
    "compact": ["--oasis", "compact"],
    "plain": ["--oasis", "plain"],
    "smallest": ["--oasis", "smallest"],
}
# A design of more pillars takes seconds for each file: only its folded layouts are written where nobody waits.
FULL_SIZE_PILLARS = 5_000_000
# Of more pillars than this, layouts that are not folded have tens of gigabytes.
HELD_PILLARS = 200_000_000
# Full-size designs whose flat layouts (4 and 10 GB) are written; others differ from the first by their phase alone.
FLAT = ["prototype_3x3", "wide_5x5"]
# Small designs, one for each kind of pillar, lattice, array and phase.
SMALL = [
    "mini_3x3", "array_2x4", "asi_940", "birefringent_532", "geometric_phase_532", "hexagonal_1550", "hologram", "mixed_lenses",
    "silicon_10600", "tio2_532",
]  # fmt: skip
# Those that are simulated and handed over: squares, circles on a hexagonal lattice, rotated rectangles; upright ones, whose
# library takes minutes, are simulated only where nobody waits.
SIMULATED = ["mini_3x3", "hexagonal_1550", "geometric_phase_532"]
SLOWLY_SIMULATED = ["birefringent_532"]
# Memory (MB) that a simulation of LARGER is given, on one thread: for the whole, for parts, for nothing.
MEMORY_MB = [8000, 66, 10]
LARGER = "neural_nano_optics"
# Files of a folder whose words are free; pictures on pages are drawn from numbers that are compared.
PAGES = {".html", ".svg", ".md", ".txt"}

Answers = dict[str, object]


def designs(program: Program) -> list[str]:
    """The names of the designs that come with a program, as its help lists them."""
    text = " ".join(program.must("new", "--help").out.split())
    names = re.search(r"--like <\w+>.*?\[possible values: ([^\]]*)\]", text)
    assert names, "`new --help` lists no designs"
    return names.group(1).split(", ")


def ended(done) -> dict:
    return {"exit": done.code}


def as_json(done) -> object:
    """What a command printed as JSON, or nothing."""
    try:
        return json.loads(done.out)
    except ValueError:
        return "no JSON"


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def shipped(program: Program) -> Answers:
    answers: Answers = {"names": designs(program)}
    for name in designs(program):
        folder = Path("shipped") / name
        (program.folder / folder).mkdir(parents=True)
        program.must("new", folder / f"{name}.toml", "--like", name)
        files = sorted(p for p in (program.folder / folder).rglob("*") if p.is_file() and p.suffix != ".toml")
        answers[name] = {str(p.relative_to(program.folder / folder)): {"file": [sha256(p)] * 2} for p in files}
    return answers


def waits(name: str, pillars: int, hierarchy: str, form: str) -> bool | None:
    """Whether a layout is written only where nobody waits; nothing if it never is."""
    if pillars <= FULL_SIZE_PILLARS:
        return False
    if hierarchy == "flat" and name not in FLAT or hierarchy != "folded" and pillars > HELD_PILLARS:
        return None
    return hierarchy != "folded" or form in ("plain", "smallest") or form == "gds" and pillars > HELD_PILLARS


def layouts(name: str, slow: bool) -> Callable[[Program], Answers]:
    """The layouts of a design: those that take no time, or the others."""

    def task(program: Program) -> Answers:
        answers: Answers = {}
        design, out = program.design(name), Path("out") / name

        def write(hierarchy: str, form: str) -> object:
            arguments = ["layout", design, "--hierarchy", hierarchy, *FORMATS[form], "--json"]
            done, files = program.digests(out, *arguments)
            report = as_json(done)
            answers[f"{hierarchy} {form}"] = {
                **ended(done), "report": report, "files": {k: {"file": v} for k, v in files.items()},
            }  # fmt: skip
            return report

        # The smallest file says how many pillars there are.
        report = write("folded", "compact")
        pillars = report["pillars"] if isinstance(report, dict) else 0
        for hierarchy in HIERARCHIES:
            for form in FORMATS:
                if f"{hierarchy} {form}" not in answers and waits(name, pillars, hierarchy, form) is slow:
                    write(hierarchy, form)
        return answers

    return task


def foreign(program: Program) -> list[Path]:
    folder = program.take("golden/foreign")
    return sorted(folder / p.name for p in (program.folder / folder).iterdir())


def golden(program: Program) -> list[Path]:
    """The golden layouts of the small design, unpacked."""
    folder = program.take("golden/mini_3x3")
    packed = sorted((program.folder / folder).glob("*.gds.gz"))
    for path in packed:
        path.with_suffix("").write_bytes(gzip.decompress(path.read_bytes()))
    return [folder / p.with_suffix("").name for p in packed]


def convert(program: Program) -> Answers:
    answers: Answers = {}
    sources = foreign(program) + golden(program)
    sources += [program.layout("mini_3x3", "--oasis", encoding) for encoding in ("compact", "plain", "smallest")]
    for source in sources:
        for suffix, form in ((".gds", []), (".oas", []), (".gds", ["--format", "oasis"])):
            to = Path("converted") / ("other" + suffix)
            (program.folder / to).parent.mkdir(exist_ok=True)
            done = program.run("convert", source, to, *form)
            there = (program.folder / to).exists()
            digest = sha256(program.folder / to) if there else "no file"
            answers[f"{source} as {suffix}{' '.join(form)}"] = {**ended(done), "file": {"file": [digest] * 2}}
            (program.folder / to).unlink(missing_ok=True)
    return answers


def checked(program: Program, *arguments, stdin: bytes | None = None) -> Answers:
    """A check in all its forms."""
    done = program.run("check", *arguments, stdin=stdin)
    forms_of = {"text": {**ended(done), "summary": forms.check_text(done.out) if done.out else []}}
    readers = {"lyrdb": forms.xml, "junit": forms.xml, "sarif": json.loads}
    done = program.run("check", *arguments, "--json", stdin=stdin)
    forms_of["json"] = {**ended(done), "report": as_json(done)}
    for form, read in readers.items():
        done = program.run("check", *arguments, f"--{form}", "-", stdin=stdin)
        forms_of[form] = {**ended(done), "report": read(done.out) if done.out else ""}
    return forms_of


def check(program: Program) -> Answers:
    answers: Answers = {}
    for name in SMALL:
        answers[f"{name} with its design"] = checked(program, program.layout(name), "--design", program.design(name))
        answers[f"{name} alone"] = checked(program, program.layout(name))
    mini = program.layout("mini_3x3")
    answers["mini_3x3 in OASIS"] = checked(
        program, program.layout("mini_3x3", "--oasis", "compact"), "--design", program.design("mini_3x3")
    )
    answers["another design"] = checked(
        program, program.layout("array_2x4"), "--design", program.design("mini_3x3"), "--markers", 1000
    )
    for path in foreign(program):
        answers[str(path)] = checked(program, path)
    # The rules of the openings, as the program puts them into a hand-off.
    program.must("handoff", program.design("mini_3x3"), "--out", "for_rules", "--fast", "--fidelity", "published")
    rules = sorted((program.folder / "for_rules/inputs").glob("rules_*apertures.toml"))
    assert rules, "a hand-off holds no rules of apertures"
    apertures = mini.with_name("mini_3x3_apertures.gds")
    options = ["--rules", rules[0], "--design", program.design("mini_3x3")]
    answers["apertures"] = checked(program, apertures, *options, "--with", mini)
    answers["apertures without pillars"] = checked(program, apertures, *options)
    answers["standard input"] = checked(program, "-", stdin=(program.folder / mini).read_bytes())
    (program.folder / "noise.gds").write_bytes(b"no layout at all")
    answers["no layout"] = ended(program.run("check", "noise.gds"))
    answers["no file"] = ended(program.run("check", "none.gds"))
    answers["two forms on standard output"] = ended(program.run("check", mini, "--junit", "-", "--json"))
    answers["waived"] = waived(program)
    return answers


def waived(program: Program) -> Answers:
    """A check some of whose violations are accepted."""
    arguments = [program.layout("array_2x4"), "--design", program.design("mini_3x3")]
    report = as_json(program.run("check", *arguments, "--json"))
    found = [(rule["id"], marker["hash"]) for rule in report["rules"] for marker in rule["markers"][:2]]
    waiver = '[[waiver]]\nrule = "{}"\nhash = "{}"\nreason = "a test"\nauthor = "a script"\nexpires = "2999-12-31"\n'
    (program.folder / "waivers.toml").write_text("".join(waiver.format(*pair) for pair in found))
    return checked(program, *arguments, "--waivers", "waivers.toml")


def diff(program: Program) -> Answers:
    answers: Answers = {}
    files = foreign(program) + golden(program)
    files += [program.layout("mini_3x3"), program.layout("mini_3x3", "--oasis", "plain"), program.layout("array_2x4")]
    for pair in list(zip(files, files[1:])) + [(files[0], files[0])]:
        done = program.run("diff", *pair, "--json")
        answers[" and ".join(map(str, pair))] = {**ended(done), "report": as_json(done)}
    (program.folder / "noise.gds").write_bytes(b"no layout at all")
    answers["no layout"] = ended(program.run("diff", files[0], "noise.gds"))
    return answers


def handoff(name: str) -> Callable[[Program], Answers]:
    def task(program: Program) -> Answers:
        out = Path("handed") / name
        cell = ["--fidelity", "published"] if name == "mini_3x3" else []
        done = program.run("handoff", program.design(name), "--out", out, "--fast", *cell)
        answers: Answers = {"made": ended(done)}
        answers["whole"] = ended(program.run("handoff", "--verify", out))
        folder = program.folder / out
        listed = sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())
        answers["files"] = listed
        for file in listed:
            path = folder / file
            answers[file] = handed(path)
        (folder / "job").mkdir(exist_ok=True)
        (folder / "job" / "other.txt").write_text("not in the manifest")
        answers["altered"] = ended(program.run("handoff", "--verify", out))
        return answers

    return task


def handed(path: Path) -> object:
    """A file of a hand-off without its words."""
    match path.suffix:
        case ".gds" | ".oas" | ".lyp":
            return {"file": [sha256(path)] * 2}
        case ".json" if path.name == "manifest.json":
            # Sizes and digests are of pages too.
            return sorted(json.loads(path.read_text())["files"])
        case ".json" if path.parent.name == "verification":
            return {"light": json.loads(path.read_text())}
        case ".json":
            return json.loads(path.read_text())
        case ".csv":
            return forms.table(path.read_text())
        case ".sdf" | ".jdf":
            return forms.job(path.read_text())
        case ".toml" if path.parent.name == "checks":
            return re.findall(r'^(?:rule|hash) = "(.*)"$', path.read_text(), re.M)
        case ".lyrdb" | ".xml":
            return forms.xml(path.read_text())
        case ".sarif":
            return json.loads(path.read_text())
    # Pages, and inputs, whose keys may have other names.
    return "free"


def run(name: str) -> Callable[[Program], Answers]:
    def task(program: Program) -> Answers:
        out = Path("runs") / name
        done = program.run("run", program.design(name), "--out", out, "--json")
        return {**ended(done), "report": {"light": as_json(done)}, **arrays(program.folder / out)}

    return task


def verify(program: Program) -> Answers:
    """A layout that is simulated whole, in parts and not at all, by what memory allows; and by other simulation models."""
    answers: Answers = {}
    larger = [program.design(LARGER), program.layout(LARGER, "--oasis", "compact"), "--fidelity", "rigorous", "--threads", 1]
    cases = {f"{mb} MB": [*larger, "--memory-mb", mb] for mb in MEMORY_MB}
    mini = [program.design("mini_3x3"), program.layout("mini_3x3")]
    cases |= {model: [*mini, "--fidelity", model] for model in ("published", "fitted")}
    for name, arguments in cases.items():
        done = program.run("verify", *arguments, "--fast", "--out", "verified", "--json")
        answers[name] = {**ended(done), "report": {"light": as_json(done)}}
    done = program.run("verify", program.design("mini_3x3"), program.layout("array_2x4"), "--fast", "--out", "verified")
    answers["another design"] = ended(done)
    return answers


def arrays(folder: Path) -> Answers:
    """Arrays and pictures of a folder."""
    answers: Answers = {}
    for path in sorted(folder.rglob("*")):
        if path.suffix in (".npy", ".png"):
            answers[str(path.relative_to(folder))] = {"kept": str(path)}
    return answers


def tables(program: Program) -> Answers:
    """The tables of pillars among unlike neighbours that come with a program, which holds them as they are."""
    inside = program.path.read_bytes()
    listed = subprocess.run(["git", "ls-files", "*neighbours-*.bin"], cwd=ROOT, capture_output=True, text=True, check=True)
    files = [ROOT / line for line in listed.stdout.splitlines()]
    assert files, "the tree has no tables"
    absent = [file.name for file in files if file.read_bytes() not in inside]
    assert not absent, f"{program.path} does not hold {len(absent)} tables as they are in the tree, the first is {absent[0]}"
    return {"tables": sorted(file.name for file in files)}


def psf(program: Program) -> Answers:
    answers: Answers = {}
    camera = program.take("cameras")
    cases = {
        "mini_3x3": (program.layout("mini_3x3"), ["--distance-um", 144, "--wavelength-nm", 530, "--samples", 96]),
        "oblique": (
            program.layout("mini_3x3"),
            ["--distance-um", 144, "--wavelength-nm", 530, "--samples", 96, "--angle-x-deg", 5, "--fast"],
        ),
        "published": (
            program.layout("mini_3x3"),
            ["--distance-um", 144, "--samples", 96, "--fidelity", "published", "--camera", camera / "gt1930.toml"],
        ),
        "foreign": (Path("golden/foreign/klayout_sref.gds"), ["--distance-um", 144, "--wavelength-nm", 530, "--samples", 64]),
    }
    foreign(program)
    exact = option(program, "psf", "--oblique", "--as-lit")
    cases["exact incidence"] = (
        program.layout("mini_3x3"),
        ["--distance-um", 144, "--wavelength-nm", 530, "--samples", 64, "--angle-x-deg", 10, "--fast", exact],
    )
    for name, (layout, options) in cases.items():
        out = Path("psfs") / name
        done = program.run("psf", layout, *options, "--out", out, "--json")
        answers[name] = {**ended(done), "report": {"light": as_json(done)}, **arrays(program.folder / out)}
    done = program.run("psf", program.layout("array_2x4"), "--extract-only", "--json")
    answers["extracted"] = {**ended(done), "report": as_json(done)}
    return answers


def option(program: Program, command: str, *names: str) -> str:
    """The first of these options that a command has: an option may have another name in the other program."""
    text = program.must(command, "--help").out
    found = [name for name in names if re.search(rf"{name}\b", text)]
    assert found, f"`{command}` has none of the options {', '.join(names)}"
    return found[0]


def cells(program: Program) -> Answers:
    done = program.run("cells", program.design("mini_3x3"), "--orders", 5, "--tolerance", 0.1, "--out", "cells", "--json")
    return {**ended(done), "report": {"light": as_json(done)}}


# Amounts on a grid: the key of random draws is a digest of the study and its design, whose words changed.
STUDY = """schema = 1
design = "{design}"
draws = 1

[[grid]]
effect = "cd_bias"
values = [-3.0, 3.0]

[[grid]]
effect = "{defocus}"
values = [-4.0, 2.0]

[[limit]]
figure = "strehl_530nm_0deg"
at_least = 0.5
"""


def study(program: Program) -> Answers:
    # The name of an effect that has another one in the older program.
    defocus = re.search(r'effect = "(defocus|gap)"', (program.files / "scripts/study/tolerance.toml").read_text())
    (program.folder / "tolerance.toml").write_text(STUDY.format(design=program.design("mini_3x3"), defocus=defocus.group(1)))
    program.must("study", "plan", "tolerance.toml", "--out", "study", "--draws-per-shard", 2)
    program.must("study", "run", "study", "--missing")
    done = program.must("study", "merge", "study", "--out", "draws.jsonl", "--psfs", 0)
    draws = (program.folder / "draws.jsonl").read_text().splitlines()
    return {**ended(done), "draws": [json.loads(line) for line in draws]}


def calibrate(program: Program) -> Answers:
    """The diagnosis of a measured set by the two effects that it has, and what commands do with the model that it gives."""
    session = program.take("golden/session")
    for defocus in ("defocus", "gap"):
        effects = ["--effects", f"cd_bias,{defocus}"]
        done = program.run("calibrate", session, *effects, "--out", "diagnosis", "--json")
        # An effect that has another name in the other program is bad input.
        if done.code != 2:
            break
    answers: Answers = {**ended(done), "diagnosis": as_json(done)}
    model, design, layout = Path("diagnosis/model.toml"), program.design("mini_3x3"), program.layout("mini_3x3")
    assert (program.folder / model).exists(), "the diagnosis gives no model"
    done, files = program.digests(Path("compensated"), "layout", design, "--compensate", model)
    # The report beside it is drawn from figures of light.
    layouts = {name: {"file": digests} for name, digests in files.items() if Path(name).suffix in (".gds", ".lyp")}
    answers["compensated"] = {**ended(done), "files": layouts}
    done = program.run("verify", design, layout, "--model", model, "--fast", "--out", "as_fabricated", "--json")
    answers["as fabricated"] = {**ended(done), "report": {"light": as_json(done)}}
    return answers


def calibrate_all(program: Program) -> Answers:
    """The diagnosis of a measured set by all effects."""
    done = program.run("calibrate", program.take("golden/session"), "--out", "diagnosis", "--json")
    return {**ended(done), "diagnosis": as_json(done)}


def picture(program: Program) -> Answers:
    camera = program.take("cameras")
    # One small lens: its kernels are as large as those of the design, and as few as can be.
    design = program.design("hexagonal_1550").with_name("small_hexagonal.toml")
    text = (program.folder / program.design("hexagonal_1550")).read_text()
    for key, value in {"diameter_um": 30, "focal_length_um": 60}.items():
        text, count = re.subn(rf"(?m)^{key} = [\d.]+", f"{key} = {value}", text, count=1)
        assert count == 1, f"hexagonal_1550 has no {key}"
    (program.folder / design).write_text(text)
    program.must("layout", design, "--out", "small")
    layout = sorted((program.folder / "small").glob("*_pillars.gds"))[0]
    arguments = [layout.relative_to(program.folder), "star", "--design", design, "--camera", camera / "swir.toml"]
    arguments += ["--pixels", 64, "--field-deg", 10, "--no-forecast", "--out", "picture", "--json"]
    done = program.run("picture", *arguments)
    return {**ended(done), "report": {"light": as_json(done)}, **arrays(program.folder / "picture")}


def refusals(program: Program) -> Answers:
    """Exit codes of what cannot be done."""
    answers: Answers = {}
    for path in sorted((program.files / "tests/broken").glob("*.toml")):
        program.take("tests/broken")
        answers[path.name] = ended(program.run("layout", Path("tests/broken") / path.name, "--out", "refused"))
    design = program.design("mini_3x3")
    answers["no design"] = ended(program.run("layout", "none.toml"))
    answers["two formats"] = ended(program.run("layout", design, "--format", "gds", "--oasis", "plain"))
    answers["no command"] = ended(program.run("none"))
    answers["a design that is there"] = ended(program.run("new", design))
    answers["a layout that is none"] = ended(program.run("verify", design, design))
    answers["no set"] = ended(program.run("calibrate", "none"))
    return answers


def all_tasks(names: list[str], slow: bool) -> dict[str, Callable[[Program], Answers]]:
    """Tasks by their names."""
    tasks: dict[str, Callable[[Program], Answers]] = {"shipped designs": shipped, "refusals": refusals}
    tasks |= {f"layouts of {name}": layouts(name, False) for name in names}
    tasks |= {"convert": convert, "check": check, "diff": diff, "tables": tables, "psf": psf, "cells": cells}
    tasks |= {"verify": verify, "study": study, "calibrate": calibrate}
    tasks |= {f"hand-off of {name}": handoff(name) for name in SIMULATED}
    tasks |= {f"run of {name}": run(name) for name in SIMULATED}
    if slow:
        tasks |= {f"hand-off of {name}": handoff(name) for name in SLOWLY_SIMULATED}
        tasks |= {f"run of {name}": run(name) for name in SLOWLY_SIMULATED}
        tasks |= {f"other layouts of {name}": layouts(name, True) for name in names}
        tasks |= {"calibrate by all effects": calibrate_all, "picture": picture}
    return tasks
