"""A corridor on two hosts, over a network that loses packets.

    python benchmarks/two_hosts.py [--scenario NAME] [--duration S] [--loss PERCENT ...]
                                   [--profile FILE.xml] [--seed N] [--json FILE]

Wayside and trains run on two hosts of this machine (``lossy_link.py``). Each row is a run with one
loss: how fast it ran, whether the digest is that of ``rail run`` on one host, which nodes were
called failed, and what the wire counted. It takes root, or
``unshare --user --map-root-user python benchmarks/two_hosts.py``.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from lossy_link import LinkedHost, LossyLink, NoLinkError
from rich.console import Console
from rich.table import Table

RAIL = [sys.executable, "-m", "rail_corridor.cli.main", "run"]
#: Wall time for the trains' half to end by itself when the wayside has finished [s].
AFTER_S = 2.0


def run_two_hosts(
    scenario: list[str],
    loss: float,
    *,
    seed: int = 1,
    patience_s: float = 600.0,
    environment: dict[str, str] | None = None,
) -> dict[str, Any]:
    """Run a corridor on two hosts; what the report and the wire say of it.

    Parameters
    ----------
    scenario : list of str
        Arguments of ``rail run``.
    loss : float
        Probability that a packet is lost.
    seed : int
        Seed of the losses.
    patience_s : float
        Wall time after which the run is interrupted [s].
    environment : dict, optional
        More environment variables.

    Raises
    ------
    NoLinkError
        Where the machine or the user may not have such a link.
    """
    inherited = {
        name: value
        for name, value in os.environ.items()
        # Hosts that may hear each other by nothing but the wire.
        if name not in ("ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTDDS_BUILTIN_TRANSPORTS")
    }
    options: dict[str, Any] = {
        "env": inherited | (environment or {}),
        "stdout": subprocess.DEVNULL,
        "stderr": subprocess.DEVNULL,
    }
    with tempfile.TemporaryDirectory() as folder, LossyLink(loss, seed) as link:
        wayside_host, onboard_host = link.hosts
        path = Path(folder) / "report.json"
        onboard = onboard_host.start([*RAIL, *scenario, "--only", "onboard"], **options)
        wayside = wayside_host.start(
            [*RAIL, *scenario, "--only", "wayside", "--report", str(path)], **options
        )
        try:
            interrupted = not _ends(wayside, patience_s)
        finally:
            for process in (wayside, onboard):
                _end(process)
        report = json.loads(path.read_text()) if path.exists() else {}
        return {
            "loss": loss,
            "real_time_factor": report.get("real_time_factor"),
            "ticks": report.get("ticks", 0),
            "complete": bool(report.get("complete")) and not interrupted,
            "failures": report.get("failures", []),
            "missing_ticks": report.get("missing_ticks"),
            "digest": report.get("digest"),
            "packets": sum(way.frames for way in link.ways),
            "octets": sum(way.octets for way in link.ways),
            "dropped": sum(way.dropped for way in link.ways),
            "overflows": sum(_overflows(host) for host in link.hosts),
        }


def _ends(process: subprocess.Popen[str], patience_s: float) -> bool:
    try:
        process.wait(patience_s)
    except subprocess.TimeoutExpired:
        return False
    return True


def _end(process: subprocess.Popen[str]) -> None:
    """End a half of a run: by itself, by Ctrl-C, and without exception."""
    if _ends(process, AFTER_S):
        return
    process.send_signal(signal.SIGINT)
    if not _ends(process, 30.0):
        process.kill()
        process.wait()


def _overflows(host: LinkedHost) -> int:
    """Packets that were lost elsewhere than on the wire: in queues of the host."""
    return host.overflow() + host.counter("Udp", "RcvbufErrors")


def one_host(scenario: list[str]) -> dict[str, Any]:
    """Report of the same run on one host."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "report.json"
        command = [*RAIL, *scenario, "--report", str(path)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        report: dict[str, Any] = json.loads(path.read_text())
        return report


def table(rows: list[dict[str, Any]], digest: str) -> Table:
    """Rows as they are printed."""
    shown = Table()
    for title in ("loss", "x real time", "digest", "failed", "packets", "dropped", "overflows"):
        shown.add_column(title, justify="right")
    for row in rows:
        factor = row["real_time_factor"]
        shown.add_row(
            f"{row['loss']:.1%}",
            f"{factor:.2f}" if factor else "-",
            "the same" if row["digest"] == digest else "another",
            str(len(row["failures"])) if row["complete"] else f"stopped at tick {row['ticks']}",
            str(row["packets"]),
            f"{row['dropped'] / max(row['packets'], 1):.2%}",
            str(row["overflows"]),
        )
    return shown


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--scenario", default="plain_line")
    parser.add_argument("--duration", type=float, default=50.0, help="simulated time [s]")
    parser.add_argument("--loss", type=float, nargs="+", default=[0.0, 0.1, 1.0, 5.0], help="[%%]")
    parser.add_argument("--profile", type=Path, help="another Fast DDS profile than that shipped")
    parser.add_argument("--seed", type=int, default=1, help="seed of the losses")
    parser.add_argument("--patience", type=float, default=600.0, help="wall time of a run [s]")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    console = Console()
    scenario = [arguments.scenario, "--duration", str(arguments.duration)]
    more = {}
    if arguments.profile is not None:
        more["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(arguments.profile.resolve())
    digest = one_host(scenario)["digest"]
    try:
        rows = [
            run_two_hosts(
                scenario,
                percent / 100.0,
                seed=arguments.seed,
                patience_s=arguments.patience,
                environment=more,
            )
            for percent in arguments.loss
        ]
    except NoLinkError as error:
        console.print(f"this machine permits no lossy link: {error}")
        return 1
    console.print(table(rows, digest))
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(rows, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
