"""Threats on the line: what the desk took against what trains gave, and a check that can fail."""

from __future__ import annotations

from collections.abc import Iterable
from math import ceil
from operator import attrgetter

import numpy as np
import pytest

from rail_corridor.equipment.train_radio.threat_metrics import (
    forged_authorities,
    report_metrics,
    threat_metrics,
)
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import run_data_of
from rail_corridor.run_data import RunData
from rail_msgs_py.topics.train_radio import ATP_STATE, AUTHORITY, REPORTS, STRIKES
from rail_msgs_py.topics.world import STATE
from rail_msgs_py.train_radio.safe_channel import SafeChannel
from rail_msgs_py.train_radio.safe_frame import FrameKind
from rail_msgs_py.train_radio.telegrams import Telegrams
from rail_msgs_py.train_radio.train_channel import CONTROLLER_IDENTITY
from rail_onboard.train_radio.supervision import AuthoritySupervision
from rail_onboard.train_radio.train_location import TrainLocation
from rail_onboard.train_radio.train_modes import ModeSupervision
from rail_onboard.train_radio.train_protection import TrainIdentity, TrainProtection
from rail_wayside.train_radio.authority_issuer import AuthorityIssuer
from rail_wayside.train_radio.moving_block import MovingBlock
from rail_wayside.train_radio.speed_profile import Segment
from rail_wayside.train_radio.train_bounds import TrainStart
from rail_world.train_radio.backbone import Backbone
from rail_world.train_radio.frame_threats import Threat
from rail_world.train_radio.threat_description import ThreatPeriod

_HOSTILE = load_scenario("hostile_network")
SCENARIO = _HOSTILE.model_copy(update={"trains": _HOSTILE.trains[:2]})
TICK_S = SCENARIO.tick_s
BASES = ("b1", "b2")
STARTS_M = {1: 1000.0, 2: 600.0}
LENGTH_M = 100.0
SPEED_MPS = 4.0
SECRET = bytes(range(32))


def recording() -> RunData:
    return run_data_of(SCENARIO)


def ride(
    threats: Iterable[Threat],
    ticks: int = 240,
    end: type[SafeChannel] = SafeChannel,
    rate: float = 0.25,
) -> tuple[RunData, AuthorityIssuer]:
    """Two trains at a steady speed, the backbone and the desk, without the air between them."""
    draw = np.random.default_rng(7).bytes
    block = MovingBlock(
        [Segment(0, "main", 5200.0, ((0.0, 20.0),))],
        [TrainStart(n, f"t{n}", LENGTH_M, 1, 0, at_m, 1.0) for n, at_m in STARTS_M.items()],
    )
    up, down = FrameKind.LOCATION_REPORT, FrameKind.MOVEMENT_AUTHORITY
    channels = {n: end(SECRET, CONTROLLER_IDENTITY, n, (up,), draw) for n in STARTS_M}
    issuer = AuthorityIssuer(block, channels, BASES)
    trains = {
        n: TrainProtection(
            TrainIdentity(n, 0, at_m, 1.0, LENGTH_M),
            end(SECRET, n, CONTROLLER_IDENTITY, (down,), draw),
            TrainLocation(0.02),
            ModeSupervision(AuthoritySupervision(LENGTH_M)),
        )
        for n, at_m in STARTS_M.items()
    }
    fields = {"rate": rate, "from_s": 2.0, "to_s": 1e6, "longest_delay_s": 3.0}
    at_work = [ThreatPeriod(threats=tuple(threats), **fields)] if threats else []
    net = Backbone(BASES, at_work, np.random.default_rng(3))
    made = recording()
    fields = attrgetter(*REPORTS.columns[1:])
    given: dict[int, bytes] = {}
    ordered: dict[str, list[tuple[int, bytes]]] = {}
    for tick in range(ticks):
        now_ns = round(tick * TICK_S * 1e9)
        heard = {base: Telegrams(now_ns, tuple(ordered.get(base, ()))).newest(2) for base in BASES}
        frames = {f"b{n}": [(n, frame)] for n, frame in given.items()}
        for n, train in trains.items():
            mine = [heard[base][n] for base in BASES if n in heard[base]]
            train.tick(now_ns, SPEED_MPS * TICK_S * tick, SPEED_MPS, mine)
            given[n] = train.frame(now_ns)
            made[ATP_STATE].put(tick, n - 1, np.array(train.state_values(now_ns)))
        rows: dict[int, list[tuple[float, ...]]] = {n: [] for n in trains}
        for base, arrived in net.up(now_ns, frames).items():
            for slot, frame in arrived:
                taken = issuer.receive(base, slot, frame, now_ns)
                if taken is not None:
                    rows[slot].append((taken.sealed_s, *fields(taken.report)))
        for n, reports in rows.items():
            values = np.array(reports, dtype=float).reshape(-1, len(REPORTS.columns))
            made.events(REPORTS).put(tick, n - 1, values)
        ordered = net.down(now_ns, issuer.telegrams(now_ns))
        for n in trains:
            made[AUTHORITY].put(tick, n - 1, np.array(issuer.authority_state(n, now_ns)))
        made[STATE].put(tick, slice(None), np.zeros((2, len(STATE.columns))))
        struck = [net.frames, *(net.strikes[threat] for threat in Threat)]
        made[STRIKES].put(tick, 0, np.array(struck, dtype=float))
    return made, issuer


def authorities(made: RunData) -> int:
    """Forged authorities of both trains."""
    tables = made[ATP_STATE].upto(made.ticks), made[AUTHORITY].upto(made.ticks)
    return sum(forged_authorities(TICK_S, *(t[:, index] for t in tables)) for index in range(2))


def test_without_threats_every_report_is_taken_and_none_is_forged() -> None:
    made, issuer = ride(())
    for index in range(2):
        values = report_metrics(SCENARIO, made, index)
        # All but those sealed while the channels were made, and the last, which was not sent yet.
        assert 230 < values["reports_taken"] == issuer.authority_state(index + 1, 0).accepted
        assert values["forged_reports"] == 0
    assert authorities(made) == 0
    assert threat_metrics(made) == {
        "frames": 2 * (240 + 239),
        "strikes": dict.fromkeys(STRIKES.columns[1:], 0),
    }


def test_under_all_threats_none_is_forged_though_many_are_rejected() -> None:
    made, issuer = ride(Threat)
    for index in range(2):
        values = report_metrics(SCENARIO, made, index)
        given = issuer.authority_state(index + 1, 0)
        assert 60 < values["reports_taken"] == given.accepted
        assert values["forged_reports"] == 0
        assert given.rejected > 60
    assert authorities(made) == 0
    assert all(count > 150 for count in threat_metrics(made)["strikes"].values())


@pytest.mark.parametrize(
    ("left_out", "threat"),
    [
        ("_genuine", Threat.CORRUPTION),
        ("_genuine", Threat.INSERTION),
        ("_genuine", Threat.MASQUERADE),
        ("_untimely", Threat.DELAY),
        ("_misplaced", Threat.REPETITION),
        ("_misplaced", Threat.RESEQUENCING),
    ],
)
def test_a_missing_check_of_the_channel_is_seen(left_out: str, threat: Threat) -> None:
    passing = {"_genuine": True, "_untimely": None, "_misplaced": None}
    weak = type("Weak", (SafeChannel,), {left_out: lambda *_: passing[left_out]})
    # Unless all are late, a frame in time makes those before it come out of order.
    rate = 1.0 if threat is Threat.DELAY else 0.25
    made, _ = ride([threat], 100, weak, rate)
    assert sum(report_metrics(SCENARIO, made, index)["forged_reports"] for index in range(2)) > 0


def test_authorities_that_a_missing_safety_code_lets_through_are_seen() -> None:
    weak = type("Weak", (SafeChannel,), {"_genuine": lambda *_: True})
    made, _ = ride([Threat.CORRUPTION], 240, weak, 0.2)
    assert authorities(made) > 0


@pytest.mark.parametrize(
    ("sealed", "end_m", "forged"),
    [
        *((5, 505.0, 0), (5, 504.99, 0), (5, 504.98, 1), (5, 506.0, 1), (6, 505.0, 1)),
        # Sealed at 5.5 at the earliest, and before it came at 7: at 6.
        *((5.5, 506.0, 0), (5.5, 505.0, 1), (5.5, 507.0, 1)),
        # The controller is not on record at 8 and later.
        *((7, 507.0, 0), (8, 507.0, 0), (8, 508.0, 1), (-1, 500.0, 1), (11.5, 507.0, 1)),
    ],
)
def test_an_authority_is_genuine_if_it_was_given_then(
    sealed: float, end_m: float, forged: int
) -> None:
    atp, given = (
        np.full((12, len(ATP_STATE.columns)), np.nan),
        np.full((12, len(AUTHORITY.columns)), 0.0),
    )
    given[:, AUTHORITY.columns.index("end_of_authority_m")] = 500.0 + np.arange(12)
    given[8:] = np.nan
    # In force for some ticks: it counts once.
    for tick in range(min(11, 1 + ceil(sealed)), 12):
        atp[tick, ATP_STATE.columns.index("end_of_authority_m")] = end_m
        atp[tick, ATP_STATE.columns.index("authority_age_s")] = (tick - sealed) * TICK_S
    assert forged_authorities(TICK_S, atp, given) == forged


@pytest.mark.parametrize(
    ("column", "value"),
    [
        *(("train", 2.0), ("segment", 1.0), ("direction", -1.0), ("integrity_confirmed", 0.0)),
        *(("offset_m", 1001.01), ("uncertainty_m", 1.2), ("sealed_s", 0.5), ("sealed_s", 0.1)),
        *(("sealed_s", 5.25), ("sealed_s", 3.75), ("position_valid", 0.0)),
    ],
)
def test_a_report_that_the_train_did_not_give(column: str, value: float) -> None:
    made = recording()
    for tick in range(21):
        made[STATE].put(tick, slice(None), np.zeros((2, len(STATE.columns))))
        belief = [0.0, 0.0, 0.0, 1000.0 + tick, 1.0, np.nan, np.inf, 2.0, 0.0]
        made[ATP_STATE].put(tick, 0, np.array(belief))
        assert len(belief) == len(ATP_STATE.columns)
    sound = dict.fromkeys(REPORTS.columns, 1.0) | {"segment": 0.0, "length_m": 118.0}
    sound |= {"sealed_s": 4.75, "offset_m": 1019.0, "uncertainty_m": 1.0, "speed_mps": 4.0}
    before = sound | {"sealed_s": 4.25, "offset_m": 1017.0}
    for told, forged in ((sound, 0), (sound | {column: value}, 1)):
        rows = np.array([list(before.values()), list(told.values())])
        made.events(REPORTS).put(20, 0, rows)
        assert report_metrics(SCENARIO, made, 0) == {"reports_taken": 2, "forged_reports": forged}


def test_a_report_from_a_train_that_had_fallen_silent_is_forged() -> None:
    made = recording()
    for tick in range(12):
        made[STATE].put(tick, slice(None), np.zeros((2, len(STATE.columns))))
        if tick < 8:
            made[ATP_STATE].put(
                tick, 0, np.array([0.0, 0.0, 0.0, 1000.0, 1.0, np.nan, np.inf, 2.0, 0.0])
            )
    row = dict.fromkeys(REPORTS.columns, 1.0) | {"segment": 0.0, "offset_m": 1000.0}
    for tick, forged in ((7, 0), (8, 0), (9, 1)):
        # What was sealed in the tick after the last record may have been sent by a dying train.
        rows = np.array([list((row | {"sealed_s": tick * TICK_S}).values())])
        made.events(REPORTS).put(10, 0, rows)
        assert report_metrics(SCENARIO, made, 0)["forged_reports"] == forged


def test_no_tick_no_strikes() -> None:
    assert threat_metrics(recording())["frames"] == 0
    assert report_metrics(SCENARIO, recording(), 0) == {"reports_taken": 0, "forged_reports": 0}


def test_a_train_that_does_not_know_its_place_gives_no_valid_position() -> None:
    made = recording()
    row = dict.fromkeys(REPORTS.columns, 1.0) | {"segment": 0.0, "offset_m": 1000.0}
    for half_m, front_m, valid in ((1.0, 1000.0, 1.0), (np.inf, np.nan, 0.0), (7e3, 1000.0, 0.0)):
        for tick in range(4):
            made[STATE].put(tick, slice(None), np.zeros((2, len(STATE.columns))))
            made[ATP_STATE].put(
                tick, 0, np.array([0.0, 0.0, 0.0, front_m, half_m, np.nan, np.inf, 2.0, 0.0])
            )
        for told in (0.0, 1.0):
            rows = np.array([list((row | {"sealed_s": TICK_S, "position_valid": told}).values())])
            made.events(REPORTS).put(3, 0, rows)
            assert report_metrics(SCENARIO, made, 0)["forged_reports"] == (told != valid)


def test_ticks_without_a_word_on_reports_or_strikes_are_missing() -> None:
    made, _ = ride((), 10)
    for index in range(2):
        made.events(REPORTS).put(12, index, np.zeros((0, len(REPORTS.columns))))
    for spec, record in zip(made.specs, made.records, strict=True):
        for tick in range(13) if spec.topic not in (REPORTS, STRIKES) else ():
            record.put(tick, slice(None), np.zeros((len(spec.rows), spec.width)))
    assert made.missing_ticks == 3  # 10 and 11, and 12 for want of strikes
    made[STRIKES].put(12, 0, np.zeros(len(STRIKES.columns)))
    assert made.missing_ticks == 2
