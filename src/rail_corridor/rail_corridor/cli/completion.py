"""Completion in the shell: scenarios, studies, topics of a running corridor, files; silent."""

from __future__ import annotations

import os
from importlib import resources
from pathlib import Path
from typing import Final

#: Wall time that a shell waits for topics.
TOPICS_S: Final = 1.5


def complete_scenario(incomplete: str) -> list[str]:
    """Built-in scenarios, and files of scenarios."""
    return [*_built_in("loading", incomplete), *_files(incomplete, (".yaml", ".yml"))]


def complete_study(incomplete: str) -> list[str]:
    """Studies that come along, and files of studies."""
    return [*_built_in("studies", incomplete), *_files(incomplete, (".yaml", ".yml"))]


def _built_in(package: str, incomplete: str) -> list[str]:
    folder = resources.files(f"rail_corridor.{package}") / "builtin"
    names = [entry.name.removesuffix(".yaml") for entry in folder.iterdir()]
    return sorted(name for name in names if name.startswith(incomplete))


def complete_recording(incomplete: str) -> list[str]:
    """Recordings."""
    return _files(incomplete, (".mcap",))


def complete_json(incomplete: str) -> list[str]:
    """JSON files, such as tracks."""
    return _files(incomplete, (".json",))


def complete_file(incomplete: str) -> list[str]:
    """Any file."""
    return _files(incomplete, ())


def complete_topic(incomplete: str) -> list[str]:
    """Topics of the corridor that is running; none if there is none."""
    try:
        return [name for name in _topics() if name.startswith(incomplete)]
    except Exception:  # in the middle of a command line nothing else can be said
        return []


def complete_trace(incomplete: str) -> list[str]:
    """Topics of the corridor that is running; behind a dot the columns of a table."""
    topic, dot, _ = incomplete.partition(".")
    if not dot:
        return complete_topic(incomplete)
    from .topic_kinds import kind_of

    kind = kind_of(topic)
    names = [f"{topic}.{column}" for column in (kind.columns if kind is not None else ())]
    return [name for name in names if name.startswith(incomplete)]


def _topics() -> list[str]:
    import time

    from .graph import graph_of

    # The middleware writes its complaints past Python.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    deadline_s = time.monotonic() + TOPICS_S
    with graph_of("rail_completion") as graph:
        graph.wait(lambda: time.monotonic() > deadline_s)
        return sorted(graph.topics())


def _files(incomplete: str, endings: tuple[str, ...]) -> list[str]:
    """Directories, and files of these endings, whose path begins so."""
    head, _, _ = incomplete.rpartition("/")
    folder = Path(head or ("/" if incomplete.startswith("/") else "."))
    try:
        entries = sorted(folder.expanduser().iterdir())
    except OSError:
        return []
    found = []
    for entry in entries:
        path = f"{head}/{entry.name}" if "/" in incomplete else entry.name
        if not path.startswith(incomplete):
            continue
        if entry.is_dir():
            found.append(f"{path}/")
        elif not endings or entry.suffix in endings:
            found.append(path)
    return found
