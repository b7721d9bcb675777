"""``rail view``: a live page for a running or replayed corridor.

`taps` reads topics, `live_state` keeps what they said, `frame` puts it into one JSON message, `web`
serves that and the page, whose drawing is done in the browser by the scripts in ``static``. What
equipment shows it says itself, by `rail_corridor.equipment.live.LiveView`.
"""
