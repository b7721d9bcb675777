"""The lock file: complete, pinned, hashed, and free of any address."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")
PINNED = re.findall(r"^([a-z0-9-]+)==", LOCK, re.MULTILINE)


def entries() -> list[str]:
    """Return the logical lines of the lock file."""
    return [line for line in LOCK.replace("\\\n", " ").splitlines() if line.strip()]


def test_every_line_pins_one_version_with_hashes() -> None:
    form = re.compile(r"[a-z0-9-]+==[^ ;]+( ; [^#]+?)?(\s+--hash=sha256:[0-9a-f]{64})+\s*")
    assert [line[:80] for line in entries() if not form.fullmatch(line)] == []


def test_no_address_of_a_package_index() -> None:
    assert re.search(r"https?:|://|--index|--find-links|--trusted|@ ", LOCK) is None


def test_every_dependency_of_the_project_is_locked() -> None:
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    tables = re.findall(r"^(?:dependencies|dev) = \[\n(.*?)^\]", text, re.MULTILINE | re.DOTALL)
    assert len(tables) == 2
    names = re.findall(r'^  "([A-Za-z0-9-]+)', "".join(tables), re.MULTILINE)
    assert len(names) > 15
    missing = {name.lower() for name in names} - set(PINNED)
    assert missing == set()


def test_the_middleware_is_locked() -> None:
    assert "ros-rmw-fastrtps-cpp" in PINNED
    assert re.search(r"^ros-rclpy==7\.1\.6\b", LOCK, re.MULTILINE)
