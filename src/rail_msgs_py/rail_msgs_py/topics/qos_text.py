"""Quality-of-service profiles as text, in the form that rosbag2 writes into its recordings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

_FOREVER: Final = {"sec": 9223372036, "nsec": 854775807}
_HISTORY: Final = {HistoryPolicy.KEEP_LAST: "keep_last", HistoryPolicy.KEEP_ALL: "keep_all"}
_RELIABILITY: Final = {
    ReliabilityPolicy.RELIABLE: "reliable",
    ReliabilityPolicy.BEST_EFFORT: "best_effort",
}
_DURABILITY: Final = {
    DurabilityPolicy.TRANSIENT_LOCAL: "transient_local",
    DurabilityPolicy.VOLATILE: "volatile",
}


def offered_profiles(profile: QoSProfile) -> str:
    """The YAML list of one profile, as in the metadata of an MCAP channel."""
    fields: dict[str, Any] = {
        "history": _HISTORY.get(profile.history, "unknown"),
        "depth": profile.depth,
        "reliability": _RELIABILITY.get(profile.reliability, "unknown"),
        "durability": _DURABILITY.get(profile.durability, "unknown"),
        "deadline": _FOREVER,
        "lifespan": _FOREVER,
        "liveliness": "automatic",
        "liveliness_lease_duration": _FOREVER,
        "avoid_ros_namespace_conventions": "false",
    }
    lines = []
    for key, value in fields.items():
        if isinstance(value, dict):
            lines += [f"{key}:", *(f"  {part}: {number}" for part, number in value.items())]
        else:
            lines.append(f"{key}: {value}")
    return "- " + "\n  ".join(lines)


def profile_from(fields: Mapping[str, Any]) -> QoSProfile:
    """The profile of one entry of such a list, read as YAML.

    Numbers, which rosbag2 wrote before Jazzy, are understood as well. A history that was not
    known when it was recorded becomes that of the ROS default.

    Raises
    ------
    ValueError
        If a field is missing or has no such value.
    """
    history = _value(fields, "history", _HISTORY)
    depth = fields.get("depth", 10)
    if not isinstance(depth, int) or not 0 <= depth <= 1_000_000:
        raise ValueError(f"depth: {depth!r}: must be a number from 0 to 1000000")
    return QoSProfile(
        history=history or HistoryPolicy.KEEP_LAST,
        depth=depth if history == HistoryPolicy.KEEP_LAST and depth else 10,
        reliability=_value(fields, "reliability", _RELIABILITY) or ReliabilityPolicy.RELIABLE,
        durability=_value(fields, "durability", _DURABILITY) or DurabilityPolicy.VOLATILE,
    )


def _value(fields: Mapping[str, Any], key: str, names: Mapping[Any, str]) -> Any:
    value = fields.get(key)
    if value in ("unknown", "system_default", "best_available", 0, 3, 4):
        return None
    for policy, name in names.items():
        if value in (name, int(policy)):
            return policy
    raise ValueError(f"{key}: {value!r}: must be one of {', '.join(names.values())}")
