"""What `rail view` costs beside a corridor at real time, and whether the corridor notices it.

A line with 114 stations and 20 trains runs at real time, once watched by a viewer with one browser
and once alone and as fast as it can. Told is the share of one core that the viewer took (its CPU
time over wall time), and whether both runs have the same digest and lost nothing.

python benchmarks/view_cost.py [SECONDS] [TAB]
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any
from urllib.parse import urlencode
from urllib.request import urlopen

from corridor_speed import line

RAIL = [sys.executable, "-m", "rail_corridor.cli.main"]
#: As often as the page asks.
ASK_S = 0.21


def main(seconds: float = 60.0, tab: str = "distance") -> dict[str, Any]:
    """Measure; SECONDS is the simulated time of each run."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scenario.yaml"
        path.write_text(line(114, 20, seconds).to_json())  # JSON is YAML
        watched = Path(folder) / "watched.json"
        view = subprocess.Popen([*RAIL, "view", "--port", "0"], stdout=subprocess.PIPE, text=True)
        try:
            assert view.stdout is not None
            found = re.search(r"http://\S+/", view.stdout.readline())
            assert found, "the viewer did not start"
            run = start(path, watched, "--rate", "1")
            cost = watch(found[0], view.pid, run, tab)
        finally:
            view.terminate()
            view.wait()
        alone = Path(folder) / "alone.json"
        start(path, alone).wait()
        one, other = (json.loads(report.read_text()) for report in (watched, alone))
    return cost | {
        "real_time_factor": one["real_time_factor"],
        "missing_ticks": one["missing_ticks"],
        "same_digest": one["digest"] == other["digest"],
    }


def start(scenario: Path, report: Path, *more: str) -> subprocess.Popen[bytes]:
    """Start a run in one process."""
    command = [*RAIL, "run", str(scenario), "--processes", "one", "--report", str(report), *more]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)


def watch(address: str, pid: int, run: subprocess.Popen[bytes], tab: str) -> dict[str, Any]:
    """Ask as a browser does until the run ends; cost of the viewer while ticks ran."""
    asked: dict[str, Any] = {"browser": "b", "train": "train7", "tab": tab}
    asked |= {"scope": "/train7/vrs/tx", "zoom": 16}
    begun: tuple[float, float] | None = None
    frames = size = 0
    while run.poll() is None:
        with urlopen(f"{address}live?{urlencode(asked)}", timeout=30.0) as answer:
            body = answer.read()
        message = json.loads(body)
        history = message["history"]
        asked |= {"run": message["run"], "generation": history["generation"]}
        asked["rows"] = history["begin"] + len(history["rows"])
        asked["lists"] = message.get("lists", {}).get("version", asked.get("lists", -1))
        if message["status"] == "running" and message["t"] > 1.0:
            if begun is None:
                begun = (time.monotonic(), cpu_s(pid))
            frames += 1
            size += len(body)
            now = (time.monotonic(), cpu_s(pid))
        time.sleep(ASK_S)
    assert begun is not None, "the run never ticked"
    span_s = now[0] - begun[0]
    return {
        "tab": tab,
        "core_share": (now[1] - begun[1]) / span_s,
        "frames_per_s": frames / span_s,
        "bytes_per_frame": size / frames,
    }


def cpu_s(pid: int) -> float:
    """CPU time of a process with all its threads [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    print(
        json.dumps(
            main(*(kind(text) for kind, text in zip((float, str), sys.argv[1:], strict=False)))
        )
    )
