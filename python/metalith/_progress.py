"""Progress of long calls, for people who watch."""

from __future__ import annotations

import sys
import time
from typing import TextIO

# Time before the first line, and between two lines in a log (s).
FIRST_S = 1.0
BETWEEN_S = 30.0


class ProgressLine:
    """A ``progress`` for any call: one line on ``file`` (standard error if left out) with the work, its share, and the time left of
    this work. It appears after a second; where ``file`` is no terminal and no notebook, once in half a minute."""

    def __init__(self, file: TextIO | None = None) -> None:
        self._file = file
        self._work = ""
        self._begun = self._told = 0.0
        self._length = 0

    def __call__(self, what: str, done: int, steps: int) -> None:
        file, now = self._file or sys.stderr, time.monotonic()
        if what != self._work:
            self._work, self._begun, self._told = what, now, now
        is_live = file.isatty() or (self._file is None and "ipykernel" in sys.modules)
        if not what or now - self._begun < FIRST_S or now - self._told < (0.0 if is_live else BETWEEN_S):
            return
        self._told = now
        share = done / steps if steps else 0.0
        left = f", about {(now - self._begun) * (1 - share) / share:.0f} s left" if share > 0 else ""
        line = f"{what}: {share:.0%}{left}"
        file.write(f"\r{line:<{self._length}}" if is_live else f"{line}\n")
        file.flush()
        self._length = len(line)
