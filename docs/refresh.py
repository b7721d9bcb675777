#!/usr/bin/env python3
"""Keep the generated parts of the documents true to the code.

A Markdown file marks a generated part with two comment lines; the first names the function that
returns its text::

    <!-- generated: package.module:function -->
    ...
    <!-- end of generated -->

``python docs/refresh.py`` rewrites every part, ``--check`` only reports the stale ones (exit 1).

What a study says takes too long to be made on every check; a document marks it with the command
and takes its tables, as many as it says, from the folder of results::

    <!-- study: rail study link_margin; tables: 2 -->
    ...
    <!-- end of study -->

``python docs/refresh.py --study link_margin.study`` rewrites those of the study in that folder.
"""

from __future__ import annotations

import importlib
import json
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PART = re.compile(
    r"(?P<open>^<!-- generated: (?P<target>[\w.]+:\w+) -->\n)(?P<body>.*?)"
    r"(?P<close>^<!-- end of generated -->$)",
    re.MULTILINE | re.DOTALL,
)
STUDY = re.compile(
    r"(?P<open>^<!-- study: rail study (?P<name>\w+)[^;\n]*; tables: (?P<tables>\d+) -->\n)"
    r"(?P<body>.*?)(?P<close>^<!-- end of study -->$)",
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


def with_study(text: str, name: str, summary: str) -> str:
    """Return a document with the tables of a study from the summary that it has written."""
    lines = [line.rstrip() for line in summary.splitlines()]
    starts = [n for n, line in enumerate(lines) if line in (name, f"{name}, continued")]
    ends = [*starts[1:], len(lines)]
    tables = ["\n".join(lines[a + 1 : b]).strip("\n") for a, b in zip(starts, ends, strict=True)]

    def part(match: re.Match[str]) -> str:
        if match["name"] != name:
            return match[0]
        body = "\n\n".join(tables[: int(match["tables"])])
        return f"{match['open']}```\n{body}\n```\n{match['close']}"

    return STUDY.sub(part, text)


def take_study(folder: Path) -> int:
    """Put the tables of a study into the documents; return the exit code."""
    name = json.loads((folder / "journal.jsonl").open(encoding="utf-8").readline())["name"]
    summary = (folder / "summary.txt").read_text(encoding="utf-8")
    for path in documents():
        old = path.read_text(encoding="utf-8")
        new = with_study(old, name, summary)
        if new != old:
            path.write_text(new, encoding="utf-8")
            print(f"{path.relative_to(ROOT)}: tables of {name}")
    return 0


def main(arguments: list[str]) -> int:
    """Refresh or check every document; return the exit code."""
    if "--study" in arguments:
        return take_study(Path(arguments[arguments.index("--study") + 1]))
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
