"""One generated scenario, run in a process of its own as ``rail run`` does: for campaigns."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any


class RunFailedError(RuntimeError):
    """A run did not come to its report."""


def report_of(
    data: Mapping[str, Any],
    label: str,
    *,
    timeout_s: float,
    arguments: Sequence[str] = (),
    domain: int | None = None,
) -> dict[str, Any]:
    """Report of a scenario.

    Parameters
    ----------
    data : mapping
        The scenario, as plain data.
    label : str
        What the run is called where it fails.
    timeout_s : float
        Wall time it may take.
    arguments : sequence of str
        More of the command line.
    domain : int, optional
        ROS domain, that of this process if not said.

    Raises
    ------
    RunFailedError
        If there is no report.
    subprocess.TimeoutExpired
    """
    with tempfile.TemporaryDirectory(prefix="rail_campaign_") as directory:
        scenario = Path(directory) / f"{data['name']}.yaml"
        report = Path(directory) / "report.json"
        scenario.write_text(json.dumps(data))
        command = [sys.executable, "-m", "rail_corridor.cli.main", "run", str(scenario)]
        command += ["--processes", "one", "--report", str(report), "--allow-failures"]
        command += arguments  # whoever asks judges the failures
        environment = dict(os.environ)
        if domain is not None:
            environment["ROS_DOMAIN_ID"] = str(domain)
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=timeout_s, env=environment
        )
        if done.returncode or not report.is_file():
            last = (done.stderr.strip() or done.stdout.strip()).splitlines()[-1:]
            raise RunFailedError(f"{label}: exit code {done.returncode}: {' '.join(last)}")
        content: dict[str, Any] = json.loads(report.read_text())
        return content


def faultless_report_of(
    data: Mapping[str, Any], label: str, *, timeout_s: float, domain: int | None = None
) -> dict[str, Any]:
    """As `report_of`; a node that failed on the way counts as no report."""
    content = report_of(data, label, timeout_s=timeout_s, domain=domain)
    for failed in content["failures"]:
        raise RunFailedError(f"{label}: {failed['node']}: {failed['reason']}")
    return content
