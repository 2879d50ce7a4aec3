"""A program that is run in a folder of its own."""

import ctypes
import hashlib
import os
import re
import shutil
import signal
import subprocess
import threading
from dataclasses import dataclass
from pathlib import Path

# Of a file that is still written, so much at its end is left alone: the writer may have blocks of it in hand.
BEHIND_BYTES = 64 << 20
# A program that is so far ahead of the hash waits: what is not hashed yet needs room on the disk.
AHEAD_BYTES = 1 << 30
# Files are hashed while they are written from this size on: what was hashed is given back to the disk.
FOLLOWED_BYTES = 256 << 20
CHUNK_BYTES = 8 << 20
# The label of a layout: the digest of its design, which also changes where a design is described otherwise.
MARK = b"sha256:"
LABEL = re.compile(rb"(?<=sha256:)[0-9a-f]{64}")
LABEL_BYTES = 80
# The checksum at the end of an OASIS file.
CRC_BYTES = 4
# FALLOC_FL_KEEP_SIZE and FALLOC_FL_PUNCH_HOLE of linux/falloc.h.
KEEP_SIZE_PUNCH_HOLE = 0x01 | 0x02


@dataclass
class Done:
    """What a run left."""

    code: int
    out: str
    err: str


class Program:
    """A program, the folder that it works in, and text files that it is given."""

    def __init__(self, path: Path, folder: Path, files: Path, cache: Path):
        self.path, self.folder, self.files = path, folder, files
        self.environment = {**os.environ, "METALITH_CACHE": str(cache), "NO_COLOR": "1"}
        folder.mkdir(parents=True)

    def run(self, *arguments, stdin: bytes | None = None, followers: "Followers | None" = None) -> Done:
        """Run a command; paths are from the folder, so that both programs see the same names."""
        started = subprocess.Popen(
            [self.path, *map(str, arguments), "--quiet"],
            cwd=self.folder,
            env=self.environment,
            stdin=subprocess.DEVNULL if stdin is None else subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        if followers:
            followers.follow(started)
        out, err = started.communicate(stdin)
        return Done(started.returncode, out.decode(), err.decode())

    def must(self, *arguments) -> Done:
        """Run a command that everything after it needs."""
        done = self.run(*arguments)
        assert done.code in (0, 1), f"{' '.join(map(str, arguments))}: exit code {done.code}: {done.err[-600:]}"
        return done

    def take(self, name: str) -> Path:
        """Copy a file or folder of the tree into the folder, by its path in the tree."""
        to = self.folder / name
        if not to.exists():
            to.parent.mkdir(parents=True, exist_ok=True)
            (shutil.copytree if (self.files / name).is_dir() else shutil.copy)(self.files / name, to)
        return Path(name)

    def design(self, name: str) -> Path:
        """A design that comes with the program, as the program writes it."""
        path = Path("designs") / f"{name}.toml"
        if not (self.folder / path).exists():
            (self.folder / "designs").mkdir(exist_ok=True)
            self.must("new", path, "--like", name)
        return path

    def layout(self, name: str, *options) -> Path:
        """The pillar layout of a design that comes with the program."""
        out = Path("layouts") / "_".join([name, *options]).replace("--", "")
        if not (self.folder / out).exists():
            self.must("layout", self.design(name), "--out", out, *options)
        return out / f"{name}_pillars.{'oas' if 'oasis' in options or '--oasis' in options else 'gds'}"

    def digests(self, out: Path, *arguments) -> tuple[Done, dict[str, list[str]]]:
        """Run a command that writes into `out`, and give two digests of each of its files, which are removed: of all bytes,
        and without the digest of the design."""
        followers = Followers(self.folder / out)
        done = self.run(*arguments, "--out", out, followers=followers)
        digests = followers.finish()
        shutil.rmtree(self.folder / out, ignore_errors=True)
        return done, digests


class Followers:
    """Digests of the files that a process writes into a folder; large ones are taken while they are written, and need no room
    on the disk."""

    def __init__(self, folder: Path):
        self.folder, self.open, self.stop = folder, {}, threading.Event()
        self.thread: threading.Thread | None = None
        self.failure: Exception | None = None

    def follow(self, process: subprocess.Popen):
        self.thread = threading.Thread(target=self._follow, args=[process], daemon=True)
        self.thread.start()

    def _follow(self, process):
        while not self.stop.wait(0.05) and self.failure is None:
            try:
                for part in list(self.folder.glob(".*.part")):
                    self._advance(part, process)
            except (AssertionError, OSError) as error:
                self.failure = error

    def _advance(self, part: Path, process):
        try:
            found = part.stat()
            if found.st_size < FOLLOWED_BYTES:
                return
            if found.st_ino not in self.open:
                self.open[found.st_ino] = _Hashing(part)
        except FileNotFoundError:
            return
        hashing, end = self.open[found.st_ino], found.st_size - BEHIND_BYTES
        too_far = end - hashing.place > AHEAD_BYTES
        if too_far:
            process.send_signal(signal.SIGSTOP)
        try:
            hashing.until(end)
        finally:
            if too_far:
                process.send_signal(signal.SIGCONT)

    def finish(self) -> dict[str, list[str]]:
        self.stop.set()
        if self.thread:
            self.thread.join()
        assert self.failure is None, f"a file could not be followed: {self.failure}"
        digests = {}
        for path in sorted(self.folder.rglob("*")):
            if path.is_file():
                hashing = self.open.get(path.stat().st_ino) or _Hashing(path)
                digests[str(path.relative_to(self.folder))] = hashing.finish(path.stat().st_size)
        return digests


class _Hashing:
    """A file that has been hashed up to some place."""

    def __init__(self, path: Path):
        self.file, self.place, self.whole = os.open(path, os.O_RDWR), 0, hashlib.sha256()
        # The digest without labels, from the first label on.
        self.unlabelled = None
        self.libc = ctypes.CDLL(None, use_errno=True)

    def until(self, end: int, last: bool = False):
        """Hash up to `end`, but for some bytes in which a label may begin if it is not the last place."""
        while self.place < end:
            chunk = os.pread(self.file, min(CHUNK_BYTES, end - self.place), self.place)
            assert chunk, "the file ends before it should"
            cut = len(chunk)
            if not (last and self.place + cut == end):
                cut -= LABEL_BYTES
            labels = list(LABEL.finditer(chunk)) if MARK in chunk else []
            if labels and labels[-1].start() - len(MARK) < cut < labels[-1].end():
                cut = labels[-1].start() - len(MARK)
            if cut <= 0:
                return
            part = memoryview(chunk)[:cut]
            if labels and self.unlabelled is None:
                self.unlabelled = self.whole.copy()
            self.whole.update(part)
            if self.unlabelled:
                self.unlabelled.update(LABEL.sub(bytes(64), part) if labels else part)
            # Where the disk takes nothing back, it needs room for the whole file.
            self.libc.fallocate(self.file, KEEP_SIZE_PUNCH_HOLE, ctypes.c_int64(self.place), ctypes.c_int64(cut))
            self.place += cut

    def finish(self, size: int) -> list[str]:
        """The digest of all, and without label and checksum."""
        self.until(max(size - CRC_BYTES, self.place), last=True)
        crc = os.pread(self.file, size - self.place, self.place)
        os.close(self.file)
        unlabelled = self.unlabelled or self.whole.copy()
        self.whole.update(crc)
        return [self.whole.hexdigest(), unlabelled.hexdigest()]
