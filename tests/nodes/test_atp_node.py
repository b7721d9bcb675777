"""Train protection as a node: obeys genuine authorities, and brakes for want of anything else."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import Plan, make_plan
from rail_msgs_py.parameters import ParameterError
from rail_msgs_py.stamps import seconds_to_ns
from rail_msgs_py.table import Table, TableWriter
from rail_msgs_py.topics.localizer import LOCALIZER_STATE, RELAYED_RANGE
from rail_msgs_py.topics.train_radio import ATP_STATE, RADIO_TELEGRAMS, TRAIN_TELEGRAMS
from rail_msgs_py.topics.world import COMMAND, ODOMETER
from rail_msgs_py.train_radio.movement_authority import MovementAuthority
from rail_msgs_py.train_radio.safe_frame import FrameKind
from rail_msgs_py.train_radio.safe_result import Accepted
from rail_msgs_py.train_radio.telegrams import Telegrams
from rail_msgs_py.train_radio.train_channel import EndSettings, controller_end
from rail_msgs_py.train_radio.train_report import WIDEST_M, LocationReport
from rail_onboard.train_radio.atp_node import AtpNode

TRAIN, NAME = "first", "/first/atp"
TICK_S = 0.25
START_M = 1200.0
TIMEOUT_S = 3.0


@pytest.fixture
def given(tmp_path: Path) -> dict[str, Any]:
    plan: Plan = make_plan(load_scenario("moving_block"), tmp_path)
    (spec,) = (spec for spec in plan.nodes if spec.name == NAME)
    # A report in every tick: what it says is asked for, not when.
    return dict(spec.parameters) | {"report_period_s": 0.05}


def last(box: list[Any]) -> dict[str, float]:
    table = Table.from_msg(box[-1])
    return table.row(table.rows[0])


class Protection:
    """The protection of the first train; the test is wheels, radio and zone controller."""

    def __init__(self, graph: Any, given: dict[str, Any], **changes: Any) -> None:
        self.graph = graph
        # Half-way between its ticks the zone controller takes and gives frames.
        given = given | {"tick_s": TICK_S / 2} | changes
        self.command = graph.mailbox(COMMAND, train=TRAIN, supervision="atp")
        self.state = graph.mailbox(ATP_STATE, train=TRAIN)
        self.telegrams = graph.mailbox(TRAIN_TELEGRAMS, train=TRAIN)
        self._odometer = graph.sender(ODOMETER, train=TRAIN)
        self._radio = graph.sender(RADIO_TELEGRAMS, train=TRAIN)
        self._wheels = TableWriter((TRAIN,), ODOMETER.columns)
        self.controller = self.new_controller(given)
        self.frames: list[bytes] = []
        self.ticks = 0
        self.run_m = self._speed_mps = 0.0
        self.localizer = given.get("localizer", False)
        if self.localizer:
            self.told = graph.mailbox(RELAYED_RANGE, train=TRAIN)
            self._place = graph.sender(LOCALIZER_STATE, train=TRAIN)
            self._places = TableWriter((TRAIN,), LOCALIZER_STATE.columns)
        graph.add(AtpNode(namespace=f"/{TRAIN}", context=graph.context, parameters=given))
        graph.connect(NAME)

    @staticmethod
    def new_controller(given: dict[str, Any], **changes: Any) -> Any:
        given = given | changes
        return controller_end(
            EndSettings(given["secret"], given["seed"], given["number"], given["tick_s"])
        )

    @property
    def now_ns(self) -> int:
        return seconds_to_ns(self.ticks * TICK_S)

    @property
    def controller_ns(self) -> int:
        """Time at which the zone controller acts: half a tick ago."""
        return max(0, self.now_ns - seconds_to_ns(TICK_S / 2))

    def authority(self, end_m: float = 2000.0, **changes: Any) -> bytes:
        """Seal an authority, or a greeting while there is no session."""
        fields: dict[str, Any] = {
            "train": 1,
            "segment": 0,
            "direction": 1,
            "end_of_authority_m": end_m,
            "limit_mps": 20.0,
            "validity_s": TIMEOUT_S,
        }
        told = MovementAuthority(**fields | changes)
        return bytes(
            self.controller.seal(FrameKind.MOVEMENT_AUTHORITY, told.to_bytes(), self.controller_ns)
        )

    def tick(
        self,
        frames: list[bytes] | None = None,
        *,
        speed_mps: float = 0.0,
        radio: bool = True,
        place: tuple[float, float] | None = None,
        slot: int = 1,
    ) -> dict[str, float]:
        """Play a tick in which the train gathers or loses speed; return the command."""
        count, now_ns = len(self.state), self.now_ns
        self.run_m += 0.5 * (self._speed_mps + speed_mps) * TICK_S
        self._speed_mps = speed_mps
        self._odometer(self._wheels.write(now_ns, np.array([[self.run_m, speed_mps]])))
        if radio:
            heard = tuple((slot, frame) for frame in frames or ())
            self._radio(Telegrams(now_ns, heard).to_msg())
        if self.localizer:
            low_m, high_m = place or (-math.inf, math.inf)
            row = dict.fromkeys(LOCALIZER_STATE.columns, 0.0) | {"low_m": low_m, "high_m": high_m}
            row |= {"speed_mps": speed_mps, "speed_low_mps": speed_mps, "speed_high_mps": speed_mps}
            self._place(self._places.write(now_ns, np.array([list(row.values())])))
        self.graph.wait(lambda: min(map(len, (self.state, self.command, self.telegrams))) > count)
        sent = Telegrams.from_msg(self.telegrams[-1])
        assert sent.stamp_ns == Table.from_msg(self.command[-1]).stamp_ns == now_ns
        self.frames = sent.in_slot(1)
        self.ticks += 1
        return last(self.command)

    def hears(self) -> LocationReport | None:
        """The zone controller takes what the train has just sent; its report, if it is one."""
        report = None
        for frame in self.frames:
            opened = self.controller.open(frame, self.controller_ns)
            if isinstance(opened, Accepted):
                report = LocationReport.from_bytes(opened.payload)
        return report

    def greet(self) -> None:
        """Exchange greetings until there is a session."""
        for _ in range(4):
            self.tick([self.authority()])
            self.hears()
        assert self.controller.established

    def run_up(self, speed_mps: float, end_m: float) -> None:
        """Gather speed as a train can; the way is that of the next tick."""
        shown_mps = 0.0
        while shown_mps < speed_mps:
            shown_mps = min(shown_mps + 0.2, speed_mps)
            self.tick([self.authority(end_m)], speed_mps=shown_mps)
            self.hears()

    def locate(self, front_m: float) -> dict[str, float]:
        """Tell it ranges for as long as it wants; the command then."""
        for _ in range(6):
            command = self.tick([self.authority(located=(front_m, 2.0))])
        return command


def test_it_is_released_by_an_authority_and_reports_its_place(graph: Any, given: Any) -> None:
    train = Protection(graph, given)
    held = train.tick()
    assert (held["permitted_mps"], held["service_brake"]) == (0.0, 1.0)
    assert math.isnan(last(train.state)["end_of_authority_m"])
    train.hears()
    train.greet()
    run = train.tick([train.authority(2000.0)])
    assert run["service_brake"] == run["emergency_brake"] == 0.0
    assert 15.0 < run["permitted_mps"] <= 20.0
    state = last(train.state)
    assert state["end_of_authority_m"] == 2000.0
    # Half a tick on the way, and what clocks may have drifted.
    assert TICK_S / 2 < state["authority_age_s"] < TICK_S / 2 + 1e-3
    train.run_up(4.0, 2000.0)
    train.tick([train.authority(2000.0)], speed_mps=4.0)
    report = train.hears()
    assert report is not None
    assert (report.train, report.direction, report.position_valid) == (1, 1, True)
    # Placed within a metre; the wheels err by 2 % at most.
    assert train.run_m > 10.0
    assert report.offset_m == pytest.approx(START_M + train.run_m, abs=0.01)
    assert report.uncertainty_m == pytest.approx(1.0 + 0.02 * train.run_m, abs=0.11)


def test_what_others_sealed_or_sealed_for_others_is_refused(graph: Any, given: Any) -> None:
    train = Protection(graph, given)
    train.tick()
    train.hears()
    train.greet()
    genuine = train.authority(1900.0)
    forged = bytes([*genuine[:-1], genuine[-1] ^ 1])
    train.tick([forged])
    before = last(train.state)
    assert before["end_of_authority_m"] != 1900.0 and before["rejected"] == 1.0
    # In the slot of another train it is not its own; of another train or track it is refused.
    train.tick([train.authority(1900.0)], slot=2)
    train.tick([train.authority(1900.0, train=2)])
    train.tick([train.authority(1900.0, segment=1)])
    train.tick([train.authority(1900.0, direction=-1)])
    after = last(train.state)
    assert after["end_of_authority_m"] == before["end_of_authority_m"]
    assert after["rejected"] == 4.0
    # The same again is no longer new.
    good = train.authority(1900.0)
    train.tick([good])
    assert last(train.state)["end_of_authority_m"] == 1900.0
    train.tick([good])
    # One tick older than when it came.
    assert last(train.state)["authority_age_s"] == pytest.approx(1.5 * TICK_S, abs=1e-3)


def test_it_brakes_once_its_authority_is_too_old(graph: Any, given: Any) -> None:
    train = Protection(graph, given)
    train.tick()
    train.hears()
    train.greet()
    assert train.tick([train.authority()])["service_brake"] == 0.0
    for age in range(1, 12):  # up to 3 s it holds, half a tick of which it was on its way
        assert train.tick()["service_brake"] == 0.0, age
    age_s = last(train.state)["authority_age_s"]
    assert age_s == pytest.approx(TIMEOUT_S - TICK_S / 2, abs=1e-3)
    late = train.tick()
    assert (late["service_brake"], late["permitted_mps"]) == (1.0, 0.0)
    assert last(train.state)["end_of_authority_m"] == 2000.0
    told = [s.message for m in graph.diagnostics for s in m.status if "supervision" in s.name]
    assert told[-1] == "no authority"


def test_the_emergency_brake_acts_where_the_end_cannot_be_kept(graph: Any, given: Any) -> None:
    train = Protection(graph, given)
    train.tick()
    train.hears()
    train.greet()
    train.run_up(5.0, 1300.0)
    braked_m = None
    while train.run_m < 101.0:
        command = train.tick([train.authority(1300.0)], speed_mps=5.0)
        if command["emergency_brake"] and braked_m is None:
            braked_m = train.run_m
    # 5 m/s and 0.9 m/s^2 are 14 m, and what is gathered until the brake acts.
    assert braked_m is not None and 30.0 < braked_m < 100.0 - 14.0
    assert (command["permitted_mps"], command["emergency_brake"]) == (0.0, 1.0)


def test_a_radio_that_is_silent_is_named_and_the_train_brakes(graph: Any, given: Any) -> None:
    train = Protection(graph, given, timeout_s=0.05)
    held = train.tick(radio=False)
    assert held["service_brake"] == 1.0
    (failed,) = graph.failed
    assert failed.name == f"/{TRAIN}/cbtc_radio"
    assert {p.key: p.value for p in failed.values} == {"detected_by": NAME, "time_s": "0.0"}
    # It is not waited for, and it still tells its place.
    train.tick(radio=False)
    assert len(train.frames) == 1
    train.hears()
    train.greet()
    assert train.tick([train.authority()])["service_brake"] == 0.0
    assert len(graph.failed) == 1


def test_switched_off_it_brakes_and_on_again_it_knows_nothing(graph: Any, given: Any) -> None:
    train = Protection(graph, given)
    train.tick()
    train.hears()
    train.greet()
    assert train.tick([train.authority()])["service_brake"] == 0.0
    graph.switch(NAME, on=False)
    off = train.tick([train.authority()])
    assert (off["permitted_mps"], off["service_brake"], off["emergency_brake"]) == (0.0, 1.0, 1.0)
    assert train.frames == []
    graph.switch(NAME, on=True)
    # What the controller seals is of a session that the train no longer has.
    on = train.tick([train.authority()])
    assert (on["permitted_mps"], on["service_brake"]) == (0.0, 1.0)
    state = last(train.state)
    assert math.isnan(state["end_of_authority_m"]) and math.isinf(state["authority_age_s"])
    assert (state["accepted"], state["rejected"]) == (0.0, 1.0)
    assert math.isnan(state["front_m"]) and state["mode"] == 0.0
    train.hears()
    train.greet()
    # It has an authority, but moves only when it has been located.
    assert train.tick([train.authority()])["service_brake"] == 1.0
    report = train.hears()
    assert report is not None and not report.position_valid
    assert train.locate(1234.0)["service_brake"] == 0.0
    state = last(train.state)
    assert (state["front_m"], state["uncertainty_m"], state["mode"]) == (1234.0, 2.0, 1.0)


def test_a_person_lets_it_run_on_sight_until_it_is_located(graph: Any, given: Any) -> None:
    train = Protection(graph, given, releases_s=(2.0, 4.0), on_sight_mps=4.0)
    train.ticks = 4  # not the start of the run: it knows no place
    train.tick()
    train.hears()
    train.greet()
    assert train.ticks * TICK_S > 2.0
    released = last(train.command)
    assert (released["on_sight"], released["permitted_mps"]) == (1.0, 4.0)
    assert released["service_brake"] == released["emergency_brake"] == 0.0
    assert last(train.state)["mode"] == 3.0
    report = train.hears()
    assert report is None or report.on_sight
    located = train.locate(1234.0)
    assert (located["on_sight"], located["service_brake"]) == (0.0, 0.0)
    # The second release finds a train under supervision, and is of no use later.
    while train.ticks * TICK_S < 4.5:
        train.tick([train.authority()])
    for _ in range(16):
        lost = train.tick()
    assert (lost["on_sight"], lost["service_brake"]) == (0.0, 1.0)


def test_too_fast_on_sight_it_brakes(graph: Any, given: Any) -> None:
    train = Protection(graph, given, releases_s=(1.0,), on_sight_mps=2.0)
    train.ticks = 4
    assert train.tick()["on_sight"] == 1.0
    shown = {}
    for tick in range(1, 24):
        shown[0.2 * tick] = train.tick(speed_mps=0.2 * tick)
    assert all(not shown[v]["service_brake"] for v in shown if v <= 2.7)
    over = [v for v in shown if v > 2.71]
    assert all(shown[v]["service_brake"] and shown[v]["traction_cut_off"] for v in over)
    assert all(shown[v]["emergency_brake"] == (v > 4.01) for v in shown)


def test_with_a_localizer_it_is_where_that_says_or_where_ranges_say(graph: Any, given: Any) -> None:
    train = Protection(graph, given, localizer=True)
    train.ticks = 4  # not the start of the run
    train.tick(place=(1250.0, 1254.0))
    train.hears()
    for _ in range(4):
        train.tick([train.authority()], place=(1250.0, 1254.0))
        train.hears()
    located = (1251.5, 2.0)
    told = train.authority(2000.0, located=located)
    assert train.tick([told], place=(1250.0, 1254.0))["service_brake"] == 0.0
    state = last(train.state)
    assert (state["front_m"], state["uncertainty_m"]) == (1252.0, 2.0)
    # What the wayside ranged goes on to the localizer, of the very time it was sealed.
    graph.wait(lambda: len(train.told) >= train.ticks - 4)
    sealed_s = (train.ticks - 1.5) * TICK_S
    assert list(last(train.told).values()) == pytest.approx([sealed_s, *located], abs=1e-3)
    lost = train.tick([train.authority()], place=None)
    assert lost["service_brake"] == 1.0
    assert math.isnan(last(train.state)["front_m"])
    # Ranges and odometer alone locate it too.
    assert train.locate(1251.5)["service_brake"] == 0.0
    state = last(train.state)
    assert (state["front_m"], state["uncertainty_m"]) == (1251.5, 2.0)
    assert train.tick([train.authority()], place=(1250.0, 1254.0))["service_brake"] == 0.0
    assert last(train.state)["front_m"] == 1252.0


def test_an_emergency_stop_stops_a_train_with_track_ahead(graph: Any, given: Any) -> None:
    train = Protection(graph, given)
    train.tick()
    train.hears()
    train.greet()
    train.run_up(5.0, 2000.0)
    run = train.tick([train.authority(2000.0)], speed_mps=5.0)
    assert run["emergency_brake"] == 0.0
    stopped = train.tick([train.authority(2000.0, emergency_stop=True)], speed_mps=5.0)
    assert run["permitted_mps"] > 15.0 and stopped["permitted_mps"] <= 5.0
    assert (stopped["service_brake"], stopped["emergency_brake"]) == (1.0, 1.0)


def test_a_place_too_wide_for_a_report_is_reported_as_not_known(graph: Any, given: Any) -> None:
    train = Protection(graph, given, localizer=True)
    train.tick(place=(1250.0, 1254.0))
    train.hears()
    for _ in range(4):
        train.tick([train.authority()], place=(1250.0, 1254.0))
        train.hears()
    for half_m, valid in ((WIDEST_M - 0.5, True), (WIDEST_M + 0.5, False)):
        train.tick([train.authority()], place=(8000.0 - half_m, 8000.0 + half_m))
        report = train.hears()
        assert report is not None and report.position_valid is valid
        assert report.uncertainty_m == pytest.approx(min(half_m, WIDEST_M), abs=0.1)


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        ({"secret": "no digits"}, "atp: "),
        ({"secret": "00"}, "atp: secret"),
        ({"emergency_mps2": 0.1}, "atp: emergency_mps2"),
        ({"gradient_permil": (-90.0,)}, "atp: fall_permil"),
        ({"authority_timeout_s": math.nan}, "authority_timeout_s"),
    ],
)
def test_wrong_parameters_are_one_line(graph: Any, wrong: dict[str, Any], line: str) -> None:
    with pytest.raises(ParameterError, match=line) as caught:
        AtpNode(context=graph.context, parameters=wrong, services=False)
    assert "\n" not in str(caught.value)
