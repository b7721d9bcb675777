"""Restarts: equipment that is started anew knows nothing of what was before."""

from __future__ import annotations

import pytest

from rail_testing.conformance.bench import Bench

REQUIREMENT = pytest.mark.requirement
#: Running time before it is restarted, in which a train gets far from where it started [s].
_BEFORE_S = 40.0
_OFF_S = 6.0


@REQUIREMENT("DESIGN, Managed nodes; nodes answer with silence when off")
@REQUIREMENT("IEEE 1474.1 6.1.2, initialization and restart [M]")
def test_switched_off_it_is_silent_and_switched_on_it_knows_nothing(bench: Bench) -> None:
    """Off: an answer in each tick that says nothing. On: as new, and soon at work again."""
    c = bench.start()
    if not bench.switchable:
        pytest.skip("offers no life cycle: it cannot be switched off")
    bench.run(_BEFORE_S)
    c.switch_off(bench.node)
    bench.run(_OFF_S, lambda: bench.kind.not_silent(bench), claims=False)
    c.switch_on(bench.node)
    bench.run(bench.tick_s, lambda: bench.kind.knows_too_much(bench))
    bench.run_until_working(bench.kind.recovers_within_s, "after it was switched on")
    bench.run(10.0)


@REQUIREMENT("DESIGN, Equipment that is switched on knows nothing of what was before")
@REQUIREMENT("IEEE 1474.1 6.1.2, initialization and restart [M]")
def test_killed_and_started_anew_it_knows_nothing(bench: Bench) -> None:
    """Its process dies in mid-run and comes back: as new, true, and soon at work again."""
    c = bench.start()
    bench.run(_BEFORE_S)
    c.kill(bench.node)
    c.run_for(_OFF_S)
    c.restart(bench.node)
    first = iter((True,))
    bench.run(
        10 * bench.tick_s,
        lambda: bench.kind.knows_too_much(bench) if next(first, False) else "",
        returning=True,
    )
    bench.run_until_working(bench.kind.recovers_within_s, "after it was started anew")
    bench.run(10.0)
