"""What the corridor asks: where the points lie, what is refused, what is announced."""

from __future__ import annotations

import json
import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from axle_counter.corridor.placement import layout_of
from axle_counter.corridor.subsystem import AXLE_COUNTER
from axle_counter.corridor.truth import empty_at_start
from axle_counter.signals.section_counter import Occupancy
from axle_counter.topics import SECTIONS
from builders import LINE

from rail_corridor.cli.decoded import decode
from rail_corridor.cli.topic_docs import ends_of, tables
from rail_corridor.equipment.registry import kind_of, node_kinds, subsystems
from rail_corridor.errors import InputError
from rail_corridor.loading.loader import builtin_scenarios, load_scenario
from rail_corridor.loading.reference_tables import field_tables
from rail_corridor.plan.announcement import announcement
from rail_corridor.plan.plan import make_plan
from rail_msgs_py.table import Table
from rail_msgs_py.topics.world import STATE

Make = Callable[..., Any]
TRAIN = LINE["trains"][0]


def test_the_corridor_finds_it_by_its_entry_point() -> None:
    assert AXLE_COUNTER in subsystems()
    for kind in AXLE_COUNTER.nodes:
        assert node_kinds()[kind.name].load().main
    name = "/wayside/dp1/wheel_sensor/passages"
    topic = kind_of(name)
    assert topic is not None
    assert topic in AXLE_COUNTER.topics
    row = Table(0, ("dp1",), topic.columns, [[1.0, 0.0, 0.0, 0.0, 1.0]]).to_msg()
    assert "forward 1" in decode(name, row)


def test_its_scenario_comes_along() -> None:
    assert load_scenario("counted_line").name == "counted_line"
    assert builtin_scenarios()["counted_line"].parent == AXLE_COUNTER.scenarios


def test_the_references_describe_it() -> None:
    assert "axle_counters" in field_tables()
    assert "MissedAxles" in field_tables()
    text = tables()
    for topic in AXLE_COUNTER.topics:
        assert topic.text in text
        assert all(column.text in text for column in topic.table)
    for kind in AXLE_COUNTER.nodes:
        assert f"### {kind.name}\n" in text
    assert "wheel_sensor_medium" in ends_of(STATE)[1]


def test_every_column_is_explained() -> None:
    tables_of = [topic for topic in AXLE_COUNTER.topics if topic.view is Table]
    assert tables_of
    assert all(topic.columns for topic in tables_of)
    told = " ".join(f"{int(value)} {value.name.replace('_', ' ').lower()}," for value in Occupancy)
    assert SECTIONS.column_texts[SECTIONS.index["occupancy"]] == told.rstrip(",")


def test_points_divide_the_track_and_a_branch_begins_in_a_section(scenario: Make) -> None:
    layout = layout_of(scenario())
    assert [(p.name, p.at_m) for p in layout.points] == [
        ("dp1", 200.0),
        ("dp2", 650.0),
        ("dp3", 1100.0),
    ]
    assert [dict(section.borders) for section in layout.sections] == [
        {"dp1": 1, "dp2": -1},
        {"dp2": 1, "dp3": -1},
    ]
    branch = load_scenario("branch")
    data = json.loads(branch.to_json()) | {"axle_counters": {"length_m": 600, "margin_m": 150}}
    layout = layout_of(scenario(**data))
    shared = next(s for s in layout.sections if len(s.borders) == 3)
    assert [span.track for span in shared.spans] == ["main", "branch"]
    first = next(p for p in layout.points if p.track == "branch")
    assert (first.name, -1) in shared.borders
    assert (shared.spans[1].start_m, shared.spans[1].end_m) == (0.0, first.at_m)


def test_only_sections_without_a_train_are_in_service_at_once(scenario: Make) -> None:
    for start_m, expected in ((195.0, ("acs1", "acs2")), (500.0, ("acs2",)), (700.0, ())):
        made = scenario(trains=[{**TRAIN, "start_m": start_m, "speed_kmh": 0}])
        assert empty_at_start(made, made.axle_counters) == expected


def test_what_is_planned_and_announced(scenario: Make, tmp_path: Path) -> None:
    made = scenario(axle_counters={**LINE["axle_counters"], "threshold": 0.4, "noise_v": 0.01})
    plan = make_plan(made, tmp_path)
    kinds = [spec.kind for spec in plan.nodes]
    assert [kinds.count(kind.name) for kind in AXLE_COUNTER.nodes] == [1, 3, 1]
    point = next(spec for spec in plan.nodes if spec.kind == "detection_point")
    part = plan.world.parts["axle_counter"]
    assert point.parameters["threshold"] == part["sensor"]["threshold"] == 0.4
    assert part["noise_v"] == 0.01
    told = json.loads(announcement(made))["axle_counter"]
    assert told["points"][1] == {"name": "dp2", "track": "main", "at_m": 650.0}
    assert told["sections"][0]["spans"] == [{"track": "main", "start_m": 200.0, "end_m": 650.0}]
    assert len(list(AXLE_COUNTER.summary(made))) == 2


def test_a_scenario_without_the_section_has_nothing_of_it(scenario: Make, tmp_path: Path) -> None:
    made = scenario(axle_counters=None)
    plan = make_plan(made, tmp_path)
    assert "axle_counter" not in plan.world.parts
    assert not {spec.kind for spec in plan.nodes} & {kind.name for kind in AXLE_COUNTER.nodes}
    assert AXLE_COUNTER.records(made) == ()
    assert AXLE_COUNTER.run_report(made, None) == {}  # type: ignore[arg-type]
    assert "axle_counter" not in json.loads(announcement(made))


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"axle_counters": {"margin_m": 650}}, "axle_counters.margin_m"),
        ({"axle_counters": {"sample_rate_hz": 400}}, "axle_counters.sample_rate_hz"),
        ({"axle_counters": {"sample_rate_hz": 8001}}, "axle_counters.sample_rate_hz"),
        ({"axle_counters": {"release": 0.5}}, "axle_counters.release"),
        ({"axle_counters": {"axles_per_car": 3}}, "axle_counters.axles_per_car"),
        ({"axle_counters": {"axles_per_car": True}}, "axle_counters.axles_per_car"),
        ({"axle_counters": {"coil_spacing_m": 0.5}}, "axle_counters.coil_spacing_m"),
        (
            {"axle_counters": {"pulse_m": 0.9, "axles_per_car": 6, "wheelbase_m": 1.0}},
            "axle_counters.wheelbase_m",
        ),
        (
            {"axle_counters": {"resets": [{"section": "acs9", "at_s": 1.0}]}},
            "axle_counters.resets.0.section",
        ),
        ({"faults": [{"kind": "missed_axles", "point": "dp9"}]}, "faults.0.point"),
        ({"faults": [{"kind": "rail_brake", "train": "b"}]}, "faults.0.train"),
        (
            {"axle_counters": None, "faults": [{"kind": "missed_axles", "point": "dp1"}]},
            "faults.0.point",
        ),
        (
            {"trains": [{**TRAIN, "start_m": 400, "enters_at_departure": True}]},
            "trains.0.start_m",
        ),
    ],
)
def test_what_does_not_fit_is_refused_by_field(
    scenario: Make, changes: dict[str, Any], field: str
) -> None:
    scenario()
    with pytest.raises(InputError) as refused:
        scenario(**changes)
    assert refused.value.field == field


@pytest.mark.parametrize("from_point_m", [4.9, 5.1])
def test_a_sensor_on_the_points_of_a_junction_is_refused(
    scenario: Make, from_point_m: float
) -> None:
    """The second of three detection points is at 650 m."""
    changes = {
        "tracks": {
            **LINE["tracks"],
            "branch": {"elements": [{"arc_m": 100, "radius_m": 300}, {"straight_m": 500}]},
        },
        "junctions": [{"track": "main", "at_m": 650.0 + from_point_m, "branch": "branch"}],
        "axle_counters": {"length_m": 450, "margin_m": 200},
    }
    if from_point_m > 5.0:
        assert len(layout_of(scenario(**changes)).sections) == 3
        return
    with pytest.raises(InputError, match="on the points") as refused:
        scenario(**changes)
    assert refused.value.field == "axle_counters.length_m"


@pytest.mark.filterwarnings("ignore:.*found in sys.modules:RuntimeWarning")
@pytest.mark.parametrize("kind", AXLE_COUNTER.nodes, ids=lambda kind: kind.name)
def test_every_node_starts_as_a_module(kind: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[str] = []
    monkeypatch.setattr(
        "rail_msgs_py.tick_node.run_node", lambda node: started.append(node.__name__)
    )
    module, _, name = kind.target.partition(":")
    runpy.run_module(module, run_name="__main__")
    assert started == [name]
