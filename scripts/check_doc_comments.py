#!/usr/bin/env python3
"""Count the doc comments that begin without a subject, and fail where their share is above a limit.

    python3 scripts/check_doc_comments.py [--list] [FOLDER ...]

A doc comment begins with a noun phrase or a verb and stands alone: generated pages and completions show its first line
without the lines around it. Looked at is the first line of each `///` and `//!` comment of the sources that git knows, below
the folders if some are named. `--list` prints the places. Exit code 0 if the share is within the limit, 1 if not.
"""

import argparse
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# Per cent of all doc comments.
LIMIT = 2.5
# Words that begin a clause, a phrase about a subject that stands elsewhere, or a pronoun for it.
WITHOUT_SUBJECT = re.compile(
    r"""
    (What|How|Whether|Which|Where|Wherever|When|Whenever|Why|Who|Whose|While|Because|Since|If|Unless|Until|Though|Than) \b
    | (Of|As|By|In|From|For|With|Without|At|On|To|Over|Along|Under|Behind|Between|Among|Beside|Before|After|Below|Above
      |Against|Around|About|Across|Through|Within|Outside|Inside|Into|Near|Per|Like|Unlike|Up|Out) \b (?! -)
    | (Those|Its|Their|They|It|Such|Nothing|None|Neither|Likewise|Also|And|But|Or|Nor|So|Else|Then|Not|Too|Same) \b
    | The\ same \b
    | That \b
    """,
    re.X,
)
# Phrases that begin so and are nouns or verbs all the same.
WITH_SUBJECT = re.compile(r"(In|Out|Up|At)-\w|Like-|Per cent|Not-a-number|At (least|most) one |Also (compare|compute|find|restore|try) |With the learnt prior, draw", re.I)


def first_lines(path: Path) -> list[tuple[int, str]]:
    """The first line of each doc comment, with its number."""
    found, inside = [], False
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        comment = re.match(r"\s*//[/!](?!/) ?(.*)", line)
        if comment and not inside and comment.group(1).strip():
            found.append((number, comment.group(1).strip()))
        inside = bool(comment)
    return found


def begins_without_subject(text: str) -> bool:
    return bool(WITHOUT_SUBJECT.match(text)) and not WITH_SUBJECT.match(text)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="*", help="look below these alone")
    parser.add_argument("--list", action="store_true", help="print the places")
    arguments = parser.parse_args()
    patterns = [f"{folder.rstrip('/')}/*.rs" for folder in arguments.folders] or ["*.rs"]
    listed = subprocess.run(["git", "ls-files", "--", *patterns], cwd=ROOT, capture_output=True, text=True, check=True)
    files = listed.stdout.split()
    total, bare, words = 0, 0, Counter()
    for file in files:
        for number, text in first_lines(ROOT / file):
            total += 1
            if begins_without_subject(text):
                bare += 1
                words[text.split()[0]] += 1
                if arguments.list:
                    print(f"{file}:{number}: {text}")
    share = 100 * bare / max(total, 1)
    most = ", ".join(f"{word} {count}" for word, count in words.most_common(8))
    print(f"{bare} of {total} doc comments begin without a subject: {share:.1f} %, at most {LIMIT} % ({most})")
    return 0 if share <= LIMIT else 1


if __name__ == "__main__":
    sys.exit(main())
