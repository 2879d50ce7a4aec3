#!/usr/bin/env python3
"""CPU time of processes that a script has started, and of a command beside a yardstick.

    python3 scripts/cpu_time.py [-n RUNS] COMMAND [ARGUMENT ...] [-- OTHER [ARGUMENT ...]]

Runs the command, or both in turns, RUNS times (3 if left out). Prints CPU seconds, peak memory, and CPU seconds over those of the
yardstick, a fixed loop that is run before and after each: on a busy machine seconds differ by half within an hour, and ratios to
the yardstick much less. For two commands it prints the ratio of each pair too. Exit code 1 if a command fails.
"""

import os
import resource
import subprocess
import sys
import time

# Turns of the loop: half a second or so, long against a tick and short against what is measured.
TURNS = 8_000_000


def children() -> float:
    """CPU time (s), user and system, of all processes that were started here and have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def yardstick() -> float:
    """CPU time (s) of the fixed loop."""
    before = time.process_time()
    value = 1
    for k in range(TURNS):
        value = (value * 1103515245 + k) & 0x7FFFFFFF
    assert value >= 0
    return time.process_time() - before


def measured(command: list[str]) -> tuple[float, int, float]:
    """CPU time (s) and peak memory (MB) of a command, and its CPU time over that of the yardstick."""
    before = yardstick()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    code = os.waitstatus_to_exitcode(status)
    # A limit that is not held is no failure.
    if code not in (0, 1):
        sys.exit(f"{command[0]} ended with {code}")
    seconds = used.ru_utime + used.ru_stime
    return seconds, used.ru_maxrss // 1024, 2 * seconds / (before + yardstick())


def main() -> int:
    words, runs = sys.argv[1:], 3
    if words[:1] == ["-n"]:
        runs, words = int(words[1]), words[2:]
    if not words or words[0] in ("-h", "--help"):
        print(__doc__)
        return 0 if words else 2
    split = words.index("--") if "--" in words else len(words)
    commands = [part for part in (words[:split], words[split + 1 :]) if part]
    for _ in range(runs):
        found = [measured(command) for command in commands]
        for command, (seconds, megabytes, ratio) in zip(commands, found, strict=True):
            print(f"{seconds:8.2f} CPU s  {megabytes:6d} MB  {ratio:8.2f} yardsticks  {' '.join(command)[:80]}")
        if len(found) == 2:
            print(f"{found[1][2] / found[0][2]:8.3f} second over first, by yardsticks")
    return 0


if __name__ == "__main__":
    sys.exit(main())
