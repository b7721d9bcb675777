"""A node in a process of its own, in whatever language, as part of a test.

Run:  .venv/bin/python -m pytest examples/test_started_by_command.py
See:  one passed: no tick goes on without the node, and the run is the same as ever.
"""

import sys
from pathlib import Path

CONTROLLER = "/wayside/zone_controller"
COMMAND = [sys.executable, str(Path(__file__).with_name("own_estimator.py")), "plain_line"]


def test_my_estimator_is_good_to_a_metre(corridor):
    """It is started by its command, and judged by where the train truly is."""
    c = corridor("plain_line", duration_s=15)
    c.add(command=COMMAND, replaces=CONTROLLER)
    position = c.topic(f"{CONTROLLER}/train_a/position")
    c.run_for(1)  # five readings, before which it claims nothing
    c.always(lambda: abs(position.latest.chainage_m - c.truth("train_a").front_m) < 1.0)
    outcome = c.run_to_end()
    assert outcome.verdict == "safe" and not outcome.report["failures"]
    assert position.count == 150
