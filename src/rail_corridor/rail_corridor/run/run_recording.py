"""A run that is recorded, seen from the launcher: file, pipes and the process that writes."""

from __future__ import annotations

import contextlib
import fcntl
import os
import time
import uuid
from collections.abc import Iterable, Mapping
from typing import Final

from rail_corridor.equipment.registry import topics
from rail_corridor.errors import InputError
from rail_corridor.recording.frames import Attachment, attachment_frame, metadata_frame
from rail_corridor.recording.part_names import Split, part_path, parts_of
from rail_corridor.recording.parts import remove_old_parts
from rail_corridor.recording.pipe_tap import CLOSED, PipeTap
from rail_corridor.recording.recorder import record
from rail_msgs_py.message_definition import message_definition, type_name
from rail_msgs_py.topics.tick import TOPICS

from .options import RecordOptions
from .processes import ProcessGroup

#: The process of the launcher itself, where the report is; no other has an empty name.
LAUNCHER: Final = ""
#: Topics on which every node publishes.
SHARED: Final = tuple(topic for topic in TOPICS if topic.shared)
_PIPE_BYTES: Final = 1024 * 1024
#: Wall time after which a recorder that takes nothing is given up. The other processes wait for
#: ever: the launcher ends them.
_STALL_S: Final = 20.0
#: Wall time for the recorder to write what it has been told.
_PATIENCE_S: Final = 60.0
_POLL_S: Final = 0.01


class RunRecording:
    """The recording of one run.

    Made, and started, before any other process of the run and before ROS.

    Parameters
    ----------
    options : RecordOptions
        What is recorded, and where; an old file is replaced, and so are its parts if it is split.
    processes : iterable of str
        Names of the processes of the run, beside the launcher's.
    attachments, metadata
        What stands at the beginning of the file.
    external_nodes : bool
        Whether nodes take part that somebody else runs: then what is on topics that they share
        with ours is heard from them, see `rail_corridor.run.external_traffic`.

    Raises
    ------
    InputError
        If the file cannot be written, a message type has no definition here, or a part would
        replace a file that is none.
    """

    def __init__(
        self,
        options: RecordOptions,
        processes: Iterable[str],
        attachments: Iterable[Attachment],
        metadata: Mapping[str, Mapping[str, str]],
        *,
        external_nodes: bool = False,
    ) -> None:
        self._options = options
        self.path = path = options.path
        split = None
        if options.split_bytes is not None:
            remove_old_parts(path)
            split = Split(path, options.split_bytes, uuid.uuid4().hex)
        try:
            for kind in {type_name(topic.type) for topic in topics()}:
                message_definition(kind)
            stream = path.open("wb")
        except LookupError as error:
            raise InputError(str(error), field="--record", value=str(path)) from None
        except OSError as error:
            reason = error.strerror or "cannot be written"
            raise InputError(reason, field="--record", value=str(path)) from None
        self._besides = frozenset(topic.name() for topic in SHARED if external_nodes)
        ends = {name: os.pipe() for name in (LAUNCHER, *processes)}
        self._reads = [read for read, _ in ends.values()]
        self._writes = {name: write for name, (_, write) in ends.items()}
        for write in self._writes.values():
            with contextlib.suppress(OSError):  # beyond what the system allows a user
                fcntl.fcntl(write, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)
        self._group = ProcessGroup()
        facts = {name: dict(values) for name, values in metadata.items()}

        def work() -> None:
            for write in self._writes.values():
                os.close(write)
            record(path, stream, self._reads, attachments, facts, split)

        self._child = self._group.start("recorder", work)
        stream.close()
        for read in self._reads:
            os.close(read)
        self.tap: PipeTap | None = None

    def tap_of(self, process: str) -> PipeTap:
        """Tap of a child process, in that process: it closes what is not its own."""
        self._group.close()
        for name, write in self._writes.items():
            if name != process:
                os.close(write)
        return PipeTap(
            self._writes[process],
            at_once=True,
            besides=self._besides,
            selection=self._options.selection,
        )

    def start(self) -> PipeTap:
        """Tap of the launcher, once all other processes have been started."""
        for name, write in self._writes.items():
            if name != LAUNCHER:
                os.close(write)
        self.tap = PipeTap(
            self._writes[LAUNCHER],
            besides=self._besides,
            selection=self._options.selection,
            stall_s=_STALL_S,
        )
        return self.tap

    def trouble(self) -> str | None:
        """Why the recording is not complete, None while all is well."""
        self._group.poll()
        if self._child.ended not in ("", "ended"):
            return f"recorder {self._child.ended}"
        return None if self.tap is None or self.tap.broken in (None, CLOSED) else self.tap.broken

    def tell(
        self, attachments: Iterable[Attachment], metadata: Mapping[str, Mapping[str, str]]
    ) -> None:
        """Add what is only known at the end."""
        assert self.tap is not None
        for attachment in attachments:
            self.tap.send(attachment_frame(attachment))
        for name, values in metadata.items():
            self.tap.send(metadata_frame(name, dict(values)))

    def describe(self) -> str:
        """The files that were written, in words."""
        more = 0 if self._options.split_bytes is None else len(parts_of(self.path)) - 1
        return f"{self.path}" + (
            f" and {more} more, to {part_path(self.path, more)}" if more else ""
        )

    def finish(self) -> str | None:
        """Wait until the file is complete, the other processes having ended; say what failed."""
        if self.tap is not None:
            self.tap.close()
        else:
            for write in self._writes.values():
                os.close(write)
        deadline_s = time.monotonic() + _PATIENCE_S
        while not self._child.ended and time.monotonic() < deadline_s:
            self._group.poll()
            time.sleep(_POLL_S)
        self._group.stop()
        return self.trouble()
