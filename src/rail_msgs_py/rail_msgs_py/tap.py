"""What the nodes of a process publish, told to a recorder as well.

A recorder that subscribes pays for every message a second time in the middleware, and can miss
some. One that is told by the publisher itself does neither: the tap belongs to the context that
the nodes of a process share, and `CorridorMixin.publisher` puts it before every publisher.
"""

from __future__ import annotations

from collections.abc import Callable

from rail_msgs_py.topics.topic import Topic

#: Takes the serialised messages of one topic.
Sink = Callable[[bytes], None]
#: Opens the sink of a publisher: kind of topic, absolute name; None if it is not to be told.
Tap = Callable[[Topic, str], Sink | None]
