#!/usr/bin/env python3
"""Keep the generated parts of the documents true to the code.

A Markdown file marks a generated part with two comment lines; the first names the function that
returns its text::

    <!-- generated: package.module:function -->
    ...
    <!-- end of generated -->

``python docs/refresh.py`` rewrites every part, ``--check`` only reports the stale ones (exit 1).
"""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PART = re.compile(
    r"(?P<open>^<!-- generated: (?P<target>[\w.]+:\w+) -->\n)(?P<body>.*?)"
    r"(?P<close>^<!-- end of generated -->$)",
    re.MULTILINE | re.DOTALL,
)


def documents() -> list[Path]:
    """Return the Markdown files that may hold generated parts."""
    return [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]


def refreshed(text: str) -> str:
    """Return a document with every generated part made anew."""

    def part(match: re.Match[str]) -> str:
        module, function = match["target"].split(":")
        body = getattr(importlib.import_module(module), function)().strip("\n")
        return f"{match['open']}{body}\n{match['close']}"

    return PART.sub(part, text)


def main(arguments: list[str]) -> int:
    """Refresh or check every document; return the exit code."""
    check = "--check" in arguments
    stale = []
    for path in documents():
        old = path.read_text(encoding="utf-8")
        new = refreshed(old)
        if new != old:
            stale.append(path.relative_to(ROOT))
            if not check:
                path.write_text(new, encoding="utf-8")
    for path in stale:
        print(f"{path}: {'stale, run python docs/refresh.py' if check else 'refreshed'}")
    return 1 if check and stale else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
