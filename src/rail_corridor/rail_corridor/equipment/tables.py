"""Tables of the report on the screen."""

from __future__ import annotations

from rich.table import Table

#: Columns of words rather than of numbers.
_WORDS = ("train", "by", "fault", "point", "section")


def new_table(title: str, *headings: str) -> Table:
    """An empty table; numbers stand to the right, names to the left."""
    table = Table(title=title, title_justify="left", title_style="bold")
    for heading in headings:
        side = "left" if heading in _WORDS else "right"
        table.add_column(heading, justify=side, no_wrap=True)  # type: ignore[arg-type]
    return table


def percent(fraction: float | None) -> str:
    """A fraction in percent; a dash for none."""
    return "-" if fraction is None else f"{100.0 * fraction:.1f} %"


def metres(value: float | None) -> str:
    """A length to the millimetre; a dash for none."""
    return "-" if value is None else f"{value:.3f}"
