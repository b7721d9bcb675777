"""Errors of positions on board, as all reports of them give them; rows of their tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from rail_signals.arrays import FloatArray

from .tables import metres, new_table, percent


def errors_of(error_m: FloatArray) -> dict[str, float | int | None]:
    """Root mean square, 95 % quantile and largest of errors; None without any."""
    size_m = np.abs(error_m[np.isfinite(error_m)])
    if not size_m.size:
        return {"rmse_m": None, "p95_m": None, "max_m": None}
    return {
        "rmse_m": float(np.sqrt(np.mean(size_m**2))),
        "p95_m": float(np.quantile(size_m, 0.95)),
        "max_m": float(size_m.max()),
    }


def fraction_of(part: NDArray[np.bool_], whole: NDArray[np.bool_]) -> float | None:
    """Fraction of the ticks of one kind in which another holds; None without any."""
    count = int(np.count_nonzero(whole))
    return float(np.count_nonzero(part)) / count if count else None


def position_table(title: str, trains: Mapping[str, Any], key: str, *more: str) -> Table | None:
    """Availability and errors of the positions under one key; None where no train has them.

    ``more`` are further values of the section, as they are shown under their names.
    """
    located = {name: train[key] for name, train in trains.items() if key in train}
    if not located:
        return None
    columns = ("rmse_m", "bound_m", "p95_m", "max_m")
    known = [column for column in columns if any(column in each for each in located.values())]
    shown = {"rmse_m": "RMSE m", "bound_m": "bound m", "p95_m": "95 % m", "max_m": "max m"}
    table = new_table(title, "train", "known", *(shown[c] for c in known), *_words(more))
    for name, each in located.items():
        values = (metres(each.get(column)) for column in known)
        table.add_row(name, percent(each["availability"]), *values, *_texts(each, more))
    return table


def _words(names: tuple[str, ...]) -> Iterator[str]:
    for name in names:
        stem, _, unit = name.rpartition("_")
        yield f"{stem.replace('_', ' ')} {unit}" if unit == "m" else name.replace("_", " ")


def _texts(section: Mapping[str, Any], names: tuple[str, ...]) -> Iterator[str]:
    for name in names:
        value = section[name]
        yield "-" if value is None else f"{value:.1f}" if isinstance(value, float) else str(value)
