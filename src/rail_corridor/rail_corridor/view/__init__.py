"""``rail view``: a live page for a running or replayed corridor.

`taps` reads topics, `picture` keeps what they said, `frame` puts it into one JSON message, `web`
serves that and the page, whose drawing is done in the browser by the scripts in ``static``.
"""
