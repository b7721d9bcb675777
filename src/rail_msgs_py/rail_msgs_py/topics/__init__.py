"""Every topic of the corridor: name, type, view, quality of service, who sends, who reads.

One module per kind of equipment; the only place that knows them. ``docs/topics.md`` is generated
from these tables, and a test compares them with a running graph.
"""
