"""Files of a program as values that can be compared: what is free (words) is left out."""

import array
import ast
import csv
import io
import re
import struct
import xml.etree.ElementTree as tree
import zlib
from pathlib import Path

from differences import PROSE

PLACE = re.compile(r"\((-?[\d.]+), (-?[\d.]+)\) um")
MARKER = re.compile(r"\[([0-9a-f]{16})\]")


def check_text(text: str) -> list:
    """The summary of `check`: of each rule its id, its count and whether it ran; places, hashes, facts; totals."""
    lines = text.splitlines()
    rows = []
    for line in lines[2:-1]:
        if not line or line.startswith("warning"):
            continue
        if not line.startswith(" "):
            rule, state, *_ = [*re.split(r"\s{2,}", line, maxsplit=2), ""]
            rows.append([rule, re.findall(r"\d+", state), state.isupper()])
            continue
        fact = re.search(r": (-?[\d.e-]+)$", line)
        values = [*PLACE.findall(line), *MARKER.findall(line), *(fact.groups() if fact else ())]
        if values:
            rows.append(values)
    # The name of the layout stands before the first colon.
    head = re.findall(r"\d+", lines[0].split(": ", 1)[-1])
    return [head, rows, re.findall(r"\d+", lines[-1])]


def xml(text: str) -> list:
    """JUnit and report databases: elements with counts and ids, of sentences the hashes and a leading count."""

    def words(value: str | None) -> str:
        value = (value or "").strip()
        if not re.search(r"\s", value) or re.match(r"(box|polygon): ", value):
            return value
        count = re.match(r"\d+ ", value)
        return PROSE + (count.group() if count else "") + " ".join(MARKER.findall(value))

    def node(element) -> list:
        attributes = {name: words(value) for name, value in element.attrib.items()}
        # Descriptions and decks are sentences, one word or not.
        free = element.tag in ("description", "original-file", "generator")
        return [element.tag, attributes, PROSE if free else words(element.text), [node(child) for child in element]]

    return node(tree.fromstring(text))


def table(text: str) -> list:
    """A CSV without its heading; numbers as numbers."""
    rows = []
    for row in list(csv.reader(io.StringIO(text)))[1:]:
        rows.append([_number(cell) for cell in row])
    return rows


def _number(cell: str):
    try:
        return float(cell)
    except ValueError:
        return cell


def job(text: str) -> list[str]:
    """A job file of a writer without its comments."""
    lines = (line.split(";", 1)[0].rstrip() for line in text.splitlines())
    return [line for line in lines if line]


def npy(path: Path) -> tuple[list[int], bytes]:
    """Shape and values, as doubles, of an array."""
    data = path.read_bytes()
    assert data[:6] == b"\x93NUMPY", path
    length, start = (struct.unpack("<H", data[8:10])[0], 10) if data[6] == 1 else (struct.unpack("<I", data[8:12])[0], 12)
    header = ast.literal_eval(data[start : start + length].decode())
    code = {"<f8": "d", "<f4": "f", "<u2": "H", "|u1": "B", "<i8": "q", "<i4": "i"}[header["descr"]]
    values = array.array(code, data[start + length :])
    return list(header["shape"]), array.array("d", values).tobytes()


def png(path: Path) -> tuple[list[int], bytes]:
    """Shape and values, as 16 bits, of a picture."""
    data = path.read_bytes()
    place, packed, head = 8, b"", None
    while place < len(data):
        length, kind = struct.unpack(">I4s", data[place : place + 8])
        body = data[place + 8 : place + 8 + length]
        if kind == b"IHDR":
            head = struct.unpack(">IIBBBBB", body)
        elif kind == b"IDAT":
            packed += body
        place += 12 + length
    columns, rows, bits, colour, _, _, interlace = head
    assert bits in (8, 16) and interlace == 0, path
    channels = {0: 1, 2: 3, 4: 2, 6: 4}[colour]
    width, step = columns * channels * bits // 8, channels * bits // 8
    raw, above, lines = zlib.decompress(packed), bytes(width), []
    for row in range(rows):
        start = row * (width + 1)
        above = _unfiltered(raw[start], bytearray(raw[start + 1 : start + 1 + width]), above, step)
        lines.append(bytes(above))
    values = array.array("H", b"".join(lines)) if bits == 16 else array.array("H", list(b"".join(lines)))
    if bits == 16:
        values.byteswap()
    return [rows, columns, channels], values.tobytes()


def _unfiltered(kind: int, line: bytearray, above: bytes, step: int) -> bytearray:
    for k in range(len(line)) if kind else ():
        left = line[k - step] if k >= step else 0
        corner = above[k - step] if k >= step else 0
        up = above[k]
        if kind == 1:
            guess = left
        elif kind == 2:
            guess = up
        elif kind == 3:
            guess = (left + up) // 2
        else:
            near = [abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)]
            guess = (left, up, corner)[near.index(min(near))]
        line[k] = (line[k] + guess) & 255
    return line
