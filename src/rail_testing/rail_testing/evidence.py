"""What is kept of a run for the case that its test fails: a recording of all but waveforms.

It is gathered as the raw frames of a recorder in a temporary file, which costs little, and made
into an MCAP file when somebody wants it.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rail_corridor.loading.scenario_files import files_of
from rail_corridor.recording.frames import Attachment
from rail_corridor.recording.pipe_tap import PipeTap
from rail_corridor.recording.run_facts import BEGIN, END, RunEnd, RunStart
from rail_corridor.recording.topic_selection import TopicSelection
from rail_corridor.stepped.corridor import SteppedCorridor
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.waveform import Waveform

_WRITE = """
import os, pickle, sys
from pathlib import Path
from rail_corridor.recording.recorder import record
path = Path(sys.argv[2])
attachments, metadata = pickle.load(sys.stdin.buffer)
frames = open(sys.argv[1], "rb")
# Of a file the end is known only by reading it; a pipe ends when it is closed.
read, write = os.pipe()
if os.fork() == 0:
    os.close(read)
    while piece := frames.read(1 << 16):
        os.write(write, piece)
    os._exit(0)
os.close(write)
record(path, path.open("wb"), [read], attachments, metadata)
"""


def said_of_health(events: Sequence[Mapping[str, Any]]) -> str:
    """What nodes last said of their health, where it was not well: a line each."""
    return "".join(
        f"\n  {event['level']:5} {event['time_s']:8.2f} s  {event['name']}: {event['message']}"
        for event in events[-8:]
        if event["level"] != "ok"
    )


@dataclass(frozen=True)
class RunNotes:
    """What a recording says of its run beside the messages: its scenario, and named values."""

    attachments: tuple[Attachment, ...]
    metadata: Mapping[str, Mapping[str, str]]

    @classmethod
    def of(cls, session: SteppedCorridor) -> RunNotes:
        """Of a run as it stands."""
        plan = session.plan
        chosen = TopicSelection(waveforms=False)
        start = RunStart(plan.scenario, plan.seed, len(plan.nodes), 1, chosen)
        end = RunEnd(session.finished, session.ticks, None)
        facts = {BEGIN: start.values(), END: end.values()}
        return cls(tuple(files_of(session.scenario)), facts)


class Evidence:
    """Gathers what nodes publish.

    Parameters
    ----------
    path : Path, optional
        Where the recording is written; without it nothing is gathered.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._tap: PipeTap | None = None
        self._frames: Path | None = None
        if path is None:
            return
        fd, name = tempfile.mkstemp(prefix="rail_testing_", suffix=".frames")
        self._frames = Path(name)
        self._tap = PipeTap(fd)

    @property
    def tap(self) -> Any:
        """Tap of the corridor's context; None if nothing is gathered."""
        return None if self._tap is None else self._of_topic

    def _of_topic(self, topic: Topic, name: str) -> Any:
        assert self._tap is not None
        return None if topic.view is Waveform else self._tap(topic, name)

    def write(self, path: Path | None, notes: RunNotes) -> Path | None:
        """Write the recording; its path, None if nothing was gathered."""
        target = path or self._path
        if self._tap is None or self._frames is None or target is None:
            return None
        self._tap.flush()
        if not self._frames.stat().st_size:
            return None
        done = subprocess.run(
            [sys.executable, "-c", _WRITE, str(self._frames), str(target)],
            input=pickle.dumps((notes.attachments, dict(notes.metadata))),
            capture_output=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            check=False,
        )
        if done.returncode:
            raise OSError(f"{target}: {(done.stderr.decode().strip().splitlines() or ['?'])[-1]}")
        return target

    def close(self) -> None:
        """Forget what was gathered."""
        if self._tap is not None:
            self._tap.close()
        if self._frames is not None:
            self._frames.unlink(missing_ok=True)
            self._frames = None
