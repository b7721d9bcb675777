"""Which topics of a run are recorded: by patterns of their names, with waveforms or without.

Patterns are those of a shell, as for ``rail figures --only``: ``*`` stands for any text, slashes
included, ``?`` for one character, ``[ab]`` for one of several. The clock goes with any topic:
without it nothing that was recorded could be replayed or set in time.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from string import Formatter
from typing import Final

from rail_msgs_py.topics.tick import CLOCK
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.waveform import Waveform

#: A set of characters in brackets, or one character.
_TOKEN: Final = re.compile(r"\[!?\]?[^]]*\]|.", re.DOTALL)


@dataclass(frozen=True)
class TopicSelection:
    """What is recorded.

    Parameters
    ----------
    patterns : tuple of str
        Of the names of topics; every topic if empty.
    waveforms : bool
        Whether topics that carry waveforms are among them.
    """

    patterns: tuple[str, ...] = ()
    waveforms: bool = True

    def takes(self, topic: Topic, name: str) -> bool:
        """Whether a topic is recorded, by its kind and its absolute name.

        >>> TopicSelection(("/train_a/*",)).takes(CLOCK, "/clock")
        True
        """
        if topic is CLOCK:
            return True
        if topic.view is Waveform and not self.waveforms:
            return False
        return not self.patterns or any(fnmatchcase(name, pattern) for pattern in self.patterns)

    def values(self) -> dict[str, str]:
        """As values of a record of the file."""
        return {
            "record_topics": ",".join(self.patterns),
            "waveforms": str(self.waveforms).lower(),
        }

    @classmethod
    def of(cls, values: Mapping[str, str]) -> TopicSelection:
        """Inverse of `values`; a file that says nothing of it holds every topic."""
        patterns = tuple(filter(None, values.get("record_topics", "").split(",")))
        return cls(patterns, values.get("waveforms", "true") != "false")

    def describe(self) -> str:
        """As on the command line; empty for every topic.

        >>> TopicSelection(("/a/*", "/b"), waveforms=False).describe()
        '--record-topics /a/*,/b --no-waveforms'
        """
        parts = [f"--record-topics {','.join(self.patterns)}"] if self.patterns else []
        return " ".join([*parts, *(["--no-waveforms"] if not self.waveforms else [])])


EVERY_TOPIC: Final = TopicSelection()


def fits_some_name(glob: str, pattern: str, words: Iterable[str]) -> bool:
    """Whether a pattern of a shell fits a name of a kind of topic.

    All names at once: what is followed are the places in ``glob`` at which it may stand after the
    part of the name that has been read.

    Parameters
    ----------
    glob : str
    pattern : str
        Of the topic, with ``{placeholders}``.
    words : iterable of str
        What a placeholder may stand for.

    Examples
    --------
    >>> fits_some_name("/tr*/vrs/channel_[12]/*", "/{train}/vrs/channel_{channel}/rx", ("tr", "2"))
    True
    >>> fits_some_name("/train/vrs/*", "/{train}/vrs/tx", ("tr", "2"))
    False
    """
    tokens, words = _TOKEN.findall(glob), tuple(words)
    places = {0}
    for literal, placeholder, _, _ in Formatter().parse(pattern):
        places = _after(tokens, places, literal)
        if placeholder is not None:
            places = set().union(*(_after(tokens, places, word) for word in words))
    return any(set(tokens[place:]) <= {"*"} for place in places)


def _after(tokens: Sequence[str], places: set[int], text: str) -> set[int]:
    """Places in a pattern, one of which it was at, after it has read a text."""
    for letter in text:
        if not places:
            break
        places = {after for place in places for after in _steps(tokens, place, letter)}
    return places


def _steps(tokens: Sequence[str], place: int, letter: str) -> Iterable[int]:
    while place < len(tokens) and tokens[place] == "*":
        yield place  # the star takes the letter, or none any more
        place += 1
    if place < len(tokens) and fnmatchcase(letter, tokens[place]):
        yield place + 1
