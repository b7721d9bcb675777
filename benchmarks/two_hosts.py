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
#: Wall time for a half of a run to end by Ctrl-C [s].
GRACE_S = 30.0


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
    environment = {
        name: value
        for name, value in {**os.environ, **(environment or {})}.items()
        # Two hosts hear each other by what a user would have, not by what tests set.
        if name not in ("ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTDDS_BUILTIN_TRANSPORTS")
    }
    with tempfile.TemporaryDirectory() as folder, LossyLink(loss, seed) as link:
        path, log = Path(folder) / "report.json", Path(folder) / "stderr"
        halves = []
        with log.open("w") as stderr:
            options: dict[str, Any] = {
                "env": environment,
                "stdout": subprocess.DEVNULL,
                "stderr": stderr,
            }
            # The wayside first: it is the one to end by itself, and to be asked first.
            for host, part in zip(link.hosts, ("wayside", "onboard"), strict=True):
                command = [*RAIL, *scenario, "--only", part]
                command += ["--report", str(path)] if part == "wayside" else []
                halves.append(host.start(command, **options))
        try:
            interrupted = not _ends(halves[0], patience_s)
        finally:
            for process in halves:
                _end(process)
        if not path.exists():
            raise RuntimeError(f"a half made no report:\n{log.read_text()}")
        report = json.loads(path.read_text())
        return {
            "loss": loss,
            "real_time_factor": report["real_time_factor"],
            "ticks": report["ticks"],
            "complete": bool(report["complete"]) and not interrupted,
            "failures": report["failures"],
            "missing_ticks": report["missing_ticks"],
            "digest": report["digest"],
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
    """End a half of a run that has not ended by itself: by Ctrl-C, and without exception."""
    if process.poll() is not None:
        return
    process.send_signal(signal.SIGINT)
    if not _ends(process, GRACE_S):
        process.kill()
        process.wait()


def _overflows(host: LinkedHost) -> int:
    """Packets lost elsewhere than on the wire: they found no room in a queue of the host."""
    return host.overflow() + host.counter("Udp", "RcvbufErrors")


def one_host(scenario: list[str]) -> dict[str, Any]:
    """Report of the same run on one host."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "report.json"
        command = [*RAIL, *scenario, "--report", str(path)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        report: dict[str, Any] = json.loads(path.read_text())
        return report


def table(rows: list[dict[str, Any]], whole: dict[str, Any]) -> Table:
    """Rows as they are printed, under the report of the run on one host."""
    shown = Table()
    for title in ("loss", "x real time", "digest", "failed", "packets", "dropped", "overflows"):
        shown.add_column(title, justify="right")
    shown.add_row("one host", f"{whole['real_time_factor']:.2f}", "", str(len(whole["failures"])))
    for row in rows:
        factor = row["real_time_factor"]
        shown.add_row(
            f"{row['loss']:.1%}",
            f"{factor:.2f}" if factor else "-",
            "the same" if row["digest"] == whole["digest"] else "another",
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
    whole = one_host(scenario)
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
    console.print(table(rows, whole))
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(rows, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
