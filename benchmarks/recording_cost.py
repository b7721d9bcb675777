"""What a recording costs: the speed of the demo with and without, and the writing alone.

``python benchmarks/recording_cost.py [PAIRS]`` prints the row ``corridor.record``: runs with and
without a recording take turns, so that whatever else the machine does falls on both, and the
ratio is the median of those of neighbours. Then what each compression of the chunks would
cost the recorder, from the messages of one such recording.
"""

from __future__ import annotations

import io
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer

from rail_corridor.recording.mcap_file import RecordingFile
from rail_corridor.recording.mcap_recorder import CHUNK_BYTES

PAIRS = 7


def rows(names: tuple[str, ...] = (), pairs: int = PAIRS) -> Iterator[dict[str, Any]]:
    """Measure, and yield the row; the ratio is the speed that is left."""
    if names and not any(name in ("corridor", "corridor.record") for name in names):
        return
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "demo.mcap"
        speed(Path(folder))  # the first run loads what the others find in memory
        with_it, without = [], []
        for _ in range(pairs):
            without.append(speed(Path(folder)))
            with_it.append(speed(Path(folder), "--record", str(recording)))
        ratios = [ours / peer for ours, peer in zip(with_it, without, strict=True)]
        yield {
            "name": "corridor.record",
            "unit": "x real time",
            "ours": statistics.median(with_it),
            "peer_name": "not recorded",
            "peer": statistics.median(without),
            "ratio": statistics.median(ratios),
            "bound": None,
            "ratios": [round(ratio, 3) for ratio in ratios],
            "megabytes": recording.stat().st_size / 1e6,
        }


def speed(folder: Path, *arguments: str) -> float:
    """Simulated seconds per second of the demo, all nodes in one process."""
    report = folder / "report.json"
    command = [sys.executable, "-m", "rail_corridor.cli.main", "run", "demo", "--processes", "one"]
    subprocess.run(
        [*command, "--report", str(report), *arguments],
        check=True,
        stdout=subprocess.DEVNULL,
        timeout=600,
    )
    return float(json.loads(report.read_text())["real_time_factor"])


def compressions() -> Iterator[dict[str, Any]]:
    """CPU time and size of the messages of the demo, written with each compression."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "demo.mcap"
        speed(Path(folder), "--record", str(path))
        with RecordingFile(path) as file:
            messages = [message for chunk in file.chunks() for message in chunk]
    for compression in CompressionType:
        stream = io.BytesIO()
        begin = time.process_time()
        writer = Writer(stream, CHUNK_BYTES, compression)
        writer.start("ros2")
        schema = writer.register_schema("any", "ros2msg", b"")
        numbers: dict[str, int] = {}
        for channel, time_ns, data, _ in messages:
            if channel.topic not in numbers:
                numbers[channel.topic] = writer.register_channel(channel.topic, "cdr", schema)
            writer.add_message(numbers[channel.topic], time_ns, data, time_ns)
        writer.finish()
        yield {
            "compression": compression.name.lower(),
            "messages": len(messages),
            "cpu_s": time.process_time() - begin,
            "megabytes": len(stream.getvalue()) / 1e6,
        }


if __name__ == "__main__":
    for row in rows(pairs=int(sys.argv[1]) if len(sys.argv) > 1 else PAIRS):
        print(json.dumps(row))
    for row in compressions():
        print(json.dumps(row))
