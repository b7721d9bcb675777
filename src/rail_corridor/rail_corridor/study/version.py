"""The version of the code that makes a run."""

from __future__ import annotations

import hashlib
import subprocess
from functools import cache
from importlib.metadata import version
from pathlib import Path


@cache
def code_version() -> str:
    """Version of the corridor, with the commit where it runs from a checkout."""
    here = Path(__file__).resolve().parent
    commit = _git(here, "describe", "--always", "--dirty").decode().strip()
    if commit.endswith("-dirty"):
        # Which changes these are: other ones may give other rows.
        commit += f".{hashlib.sha256(_git(here, 'diff', 'HEAD')).hexdigest()[:8]}"
    return f"{version('rail-corridor')}{'+' if commit else ''}{commit}"


def _git(folder: Path, *arguments: str) -> bytes:
    """What git says of a checkout; nothing where there is none."""
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *arguments], capture_output=True, check=False, timeout=10.0
        )
    except (OSError, subprocess.TimeoutExpired):
        return b""
    return done.stdout if done.returncode == 0 else b""
