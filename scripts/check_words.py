"""Hold the tests off the words of errors: an assertion on the English text of a refusal breaks when a sentence is improved.

A test matches on the identity instead: `error.id()`, `error.ids()`, `has_fault(kind, key)`, a variant, a line and column, a field of
JSON, an exit code; of the program, `error[subject/cause]` and `key/cause` on standard error. Where the words are what is tested,
the whole message is a snapshot (`insta::assert_snapshot!`).

Counted are calls of `contains` (and `starts_with`, `ends_with`) on the text of an error, with words in the literal or with a
variable that a table of words fills. The number may shrink, never grow: MOST is lowered with each that goes.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# Texts of errors that tests still look into.
MOST = 23

# What holds the text of an error: `error.to_string()`, a variable of that name, standard error, a fault.
TEXT = r"(?:to_string\(\)|\b(?:error|err|refused|said|told|why|what|missing|changed|fault|remedy\(\)|unwrap_err\(\)\)?)|&?output\.stderr\))"
CALL = re.compile(TEXT + r"\s*\.(?:contains|starts_with|ends_with)\(\s*&?\"((?:[^\"\\]|\\.)*)\"")
# A row of a table of words.
ROW = re.compile(TEXT + r"\s*\.contains\(\s*&?(wanted|words?|parts?|what|expected|why|fault|said)\)")
# Of predicates on standard error, over a break of the line too.
STDERR = re.compile(r"\.stderr\(\s*(?:predicates::str::)?contains\(\s*\"((?:[^\"\\]|\\.)*)\"")
WORDS = re.compile(r"[A-Za-z`']{2,}\s+[A-Za-z`']{2,}|^[a-z]{3,}$")
# Identities and places, which are no English.
IDENTITY = re.compile(r"^error\[|/[a-z-]+$|^'?--|:\d+:")


def found(text):
    """The places in a text where a test looks into the words of an error."""
    for match in ROW.finditer(text):
        yield text.count("\n", 0, match.start()) + 1, match.group(1)
    for pattern in (CALL, STDERR):
        for match in pattern.finditer(text):
            literal = match.group(1)
            if WORDS.search(literal) and not IDENTITY.search(literal):
                yield text.count("\n", 0, match.start()) + 1, literal


def tests_of(path):
    """The part of a file that is tests, with the lines before it left empty."""
    text = path.read_text(encoding="utf-8")
    if "tests" in path.relative_to(ROOT).parts or path.name == "tests.rs":
        return text
    begin = text.find("#[cfg(test)]")
    return "" if begin < 0 else "\n" * text.count("\n", 0, begin) + text[begin:]


def main():
    """Print what is found and answer whether there is more than there may be."""
    files = (path for folder in ("crates", "src", "tests", "python") for path in sorted((ROOT / folder).rglob("*.rs")))
    places = [
        f"{path.relative_to(ROOT)}:{line}: {literal}"
        for path in files
        if "target" not in path.parts
        for line, literal in found(tests_of(path))
    ]
    if len(places) == MOST:
        return 0
    print("\n".join(places))
    if len(places) < MOST:
        print(f"{len(places)} assertions on words of errors, {MOST} are allowed: lower MOST in scripts/check_words.py")
    else:
        print(f"{len(places)} assertions on words of errors, at most {MOST}: match on `error.id()`, or make a snapshot of the message")
    return 1


if __name__ == "__main__":
    sys.exit(main())
