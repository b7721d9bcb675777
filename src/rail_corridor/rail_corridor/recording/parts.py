"""A recording, in one file or in several parts, read as one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from rail_corridor.errors import InputError

from .frames import Attachment
from .mcap_file import RecordedChannel, RecordedMessage, RecordingFile
from .part_names import NEXT, PART, part_path, parts_of


def part_number(file: RecordingFile) -> int:
    """Which part a file is; 0 for one that is not divided."""
    text = file.metadata.get(PART, {}).get("number", "0")
    if not (text.isascii() and text.isdecimal() and len(text) < 10):
        raise InputError(
            "must be a whole number", file=str(file.path), field=f"{PART}.number", value=text
        )
    return int(text)


def remove_old_parts(first: Path) -> None:
    """Remove the parts of an earlier recording of the same name, but for the first.

    Raises
    ------
    InputError
        If a file of such a name is something else; nothing is removed then.
    """
    old = parts_of(first)[1:]
    for number, path in enumerate(old, start=1):
        is_part = False
        with suppress(InputError), RecordingFile(path) as file:
            is_part = part_number(file) == number
        if not is_part:
            reason = "is none of an earlier recording's parts, and would be replaced by one"
            raise InputError(reason, file=f"--record-split: {path}")
    for path in old:
        path.unlink()


class Recording:
    """A recording, from one of its parts on: what stands before its first message is known.

    Parameters
    ----------
    path : Path
        Of the first part, or of a later one to begin with.

    Raises
    ------
    InputError
        One line that names the file, and the byte where it is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = RecordingFile(path)
        #: Which part it begins with.
        self.number = self._number = part_number(self._file)
        self.metadata = dict(self._file.metadata)
        self._channels: dict[str, RecordedChannel] = {}
        self._attachments = {each.name: each for each in self._file.attachments}
        self._span_ns: tuple[int, int] | None = None

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.__exit__(*error)

    @property
    def last_path(self) -> Path:
        """Path of the part that was read last."""
        return self._file.path

    @property
    def cut_at(self) -> int | None:
        """Where that part ends before its time [byte], None if it is whole."""
        return self._file.cut_at

    @property
    def channels(self) -> list[RecordedChannel]:
        """Topics that have been found so far."""
        return list(self._channels.values())

    @property
    def attachments(self) -> list[Attachment]:
        """Files that have been found so far."""
        return list(self._attachments.values())

    @property
    def first_ns(self) -> int:
        """Time of the first message that was read [ns]; 0 without any."""
        return self._span_ns[0] if self._span_ns else 0

    @property
    def last_ns(self) -> int:
        """Time of the last message that was read [ns]; 0 without any."""
        return self._span_ns[1] if self._span_ns else 0

    def chunks(
        self, wanted: Callable[[RecordedChannel], bool] = lambda _: True
    ) -> Iterator[list[RecordedMessage]]:
        """Yield the messages of each chunk of each part, in their order; once.

        Parameters
        ----------
        wanted : callable of a channel
            Whether its messages are; asked once of each in each part.

        Raises
        ------
        InputError
        """
        newest: dict[str, int] = {}
        while True:
            for chunk in self._file.chunks(wanted):
                yield list(self._new(chunk, newest))
            self._take_facts()
            if NEXT not in self._file.metadata:
                return
            self._open_next()

    def _new(
        self, chunk: list[RecordedMessage], newest: dict[str, int]
    ) -> Iterator[RecordedMessage]:
        """Yield what was not there before: a part repeats what was latched, number and all."""
        first = self._number == self.number
        for message in chunk:
            topic = message.channel.topic
            if first or message.sequence > newest.get(topic, 0):
                newest[topic] = message.sequence
                yield message

    def _take_facts(self) -> None:
        """What is known of a part that has been read to its end."""
        file = self._file
        self.metadata |= {name: each for name, each in file.metadata.items() if name != NEXT}
        self._attachments |= {each.name: each for each in file.attachments}
        self._channels |= {channel.topic: channel for channel in file.channels}
        if file.holds_messages:
            first_ns, last_ns = self._span_ns or (file.first_ns, file.last_ns)
            self._span_ns = min(first_ns, file.first_ns), max(last_ns, file.last_ns)

    def _open_next(self) -> None:
        """Go on with the next part."""
        before = self._file
        before.__exit__()
        stem = self.last_path.stem
        first = stem.removesuffix(f"_{self._number}") if self._number else stem
        self._number += 1
        path = part_path(before.path.with_stem(first), self._number)
        try:
            file = RecordingFile(path)
        except InputError as error:
            raise InputError(
                f"the recording goes on there: {error.reason}", file=str(path)
            ) from None
        same = file.metadata.get(PART, {}).get("recording") == before.metadata[PART]["recording"]
        if not same or part_number(file) != self._number:
            file.__exit__()
            raise InputError(f"does not go on with {before.path.name}", file=str(path))
        self._file = file
