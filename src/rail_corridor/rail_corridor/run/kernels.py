"""Compiles the kernels before the first run on a machine, so that no tick waits for the compiler.

Short runs of scenarios that call all of them leave their machine code beside the sources, where
every later start finds it (`rail_signals.compiled`).
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Final

from rich.console import Console

import rail_signals
import rail_world
from rail_signals.compiled import cache_folder

#: Together their corridors call every kernel that a run calls.
SCENARIOS: Final = ("located_block", "located_codes")
_DURATION_S: Final = 2.0
#: Set where kernels are being compiled, so that those runs do not wait for themselves.
_UNDER_WAY: Final = "RAIL_COMPILES_KERNELS"
# Nobody is discovered there, and the corridors do not meet.
_DOMAINS: Final = (97, 98)


def compile_before_the_first_run(console: Console) -> None:
    """Compile the kernels, unless that has been done for the sources as they are."""
    marker = cache_folder(Path(__file__).parent / "__pycache__") / f"kernels-{_state()}.ready"
    if marker.is_file() or os.environ.get(_UNDER_WAY):
        return
    console.print("compiling kernels, once: this takes some twenty seconds")
    runs = [_start(scenario, domain) for scenario, domain in zip(SCENARIOS, _DOMAINS, strict=True)]
    try:
        codes = [run.wait() for run in runs]
    finally:
        for run in runs:
            run.terminate()
    if any(codes):
        return  # the run itself says what is wrong
    with contextlib.suppress(OSError):
        marker.parent.mkdir(parents=True, exist_ok=True)
        for old in marker.parent.glob("kernels-*.ready"):
            old.unlink()
        marker.touch()


def _start(scenario: str, domain: int) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "rail_corridor.cli.main", "run", scenario]
    command += ["--duration", str(_DURATION_S), "--processes", "one", "--timeout", "600"]
    settings = {
        _UNDER_WAY: "1",
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF",
    }
    return subprocess.Popen(
        command,
        env=os.environ | settings,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def _state() -> str:
    """Fingerprint of everything that is compiled."""
    digest = hashlib.sha256(sys.version.encode())
    for package in (rail_signals, rail_world):
        for path in sorted(Path(package.__path__[0]).rglob("*.py")):
            content = path.read_bytes()
            if b"@compiled" in content:
                digest.update(content)
    return digest.hexdigest()[:16]
