"""Tables in notebooks."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

# Rows of a table that a notebook shows: more hide the next cell.
MOST_ROWS = 40


def table(rows: Iterable[Sequence[object]], *, columns: Sequence[str] = (), caption: str = "") -> str:
    """An HTML table, its text escaped. Without ``columns``, the first cell of a row is its name. Numbers have four digits; None
    is a dash. Rows beyond ``MOST_ROWS`` are counted."""
    every = [[_text(cell) for cell in row] for row in rows]
    shown, more = every[:MOST_ROWS], len(every) - MOST_ROWS
    head = _row(("th", name) for name in map(_text, columns)) if columns else ""
    body = "".join(_row(("td" if columns or k else "th", cell) for k, cell in enumerate(row)) for row in shown)
    foot = f"<p>and {more} more rows</p>" if more > 0 else ""
    return f"<table><caption>{_text(caption)}</caption>{head}{body}</table>{foot}"


def _row(cells: Iterable[tuple[str, str]]) -> str:
    return "<tr>" + "".join(f"<{tag}>{text}</{tag}>" for tag, text in cells) + "</tr>"


def _text(value: object) -> str:
    """A value as escaped text."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}" if value >= 10_000 else str(value)
    return html.escape(f"{value:.4g}" if isinstance(value, float) else str(value))
