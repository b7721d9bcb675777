"""The recorder: a process of its own that writes what the processes of a run tell it.

It ends when all of them have closed their pipes, so it outlives a launcher that was killed for
as long as it takes to complete the file.
"""

from __future__ import annotations

import os
import selectors
import signal
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO, Final

from .frames import Attachment, FrameReader
from .mcap_recorder import McapRecorder, Source
from .part_names import Split, part_path

#: A chunk that nothing was added to for so long is closed.
_IDLE_S: Final = 1.0
#: Asked to end, it waits so long for pipes that somebody keeps open.
_GRACE_S: Final = 3.0


def record(
    path: Path,
    stream: BinaryIO,
    pipes: Iterable[int],
    attachments: Iterable[Attachment],
    metadata: dict[str, dict[str, str]],
    split: Split | None = None,
) -> None:
    """Write a recording until every pipe is closed; runs in the process of the recorder.

    A file that cannot be written is told in one line, and ends the process with exit code 1.
    """
    asked: list[float] = []
    signal.signal(signal.SIGTERM, lambda *_: asked.append(time.monotonic()))
    recorder: McapRecorder | None = None
    try:
        recorder = McapRecorder(stream, attachments, metadata, split)
        try:
            _drain(recorder, pipes, asked)
        finally:
            recorder.close()
            recorder.stream.close()
    except OSError as error:
        at = part_path(path, recorder.part if recorder is not None else 0)
        print(f"rail: {at}: {error.strerror or error}", file=sys.stderr, flush=True)
        os._exit(1)


def _drain(recorder: McapRecorder, pipes: Iterable[int], asked: list[float]) -> None:
    with selectors.DefaultSelector() as selector:
        for pipe in pipes:
            selector.register(pipe, selectors.EVENT_READ, (Source(), FrameReader(pipe)))
        written_s = time.monotonic()
        while selector.get_map():
            ready = selector.select(_IDLE_S)
            for key, _ in ready:
                source, reader = key.data
                try:
                    for frame in reader.read():
                        recorder.take(source, *frame)
                except EOFError:
                    selector.unregister(key.fd)
            now_s = time.monotonic()
            if now_s - written_s > _IDLE_S:
                recorder.flush()
                written_s = now_s
            if asked and now_s - asked[0] > _GRACE_S and not ready:
                return
