"""A run as a table of HTML: what was run, its events and its audit. A notebook shows it, and pages have its lines."""

from __future__ import annotations

import html
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ngalpha_pin.results.trajectory import Trajectory

MARKS = {True: ("\N{CHECK MARK}", "#1d8a4e"), False: ("\N{BALLOT X}", "#c8321f"), None: ("", "inherit")}


def summary(trajectory: Trajectory) -> str:
    """What was run, its events and its audit, as a table of HTML."""
    kinds = Counter(event.kind for event in trajectory.events)
    rows = [
        ("method", trajectory.method, "", None),
        ("time", f"{trajectory.t[0]:g} to {trajectory.t[-1]:g}", "s", None),
        ("contacts", len(trajectory.contact_names), "", None),
        ("events", ", ".join(f"{count} {kind}" for kind, count in kinds.items()) or "none", "", None),
        *trajectory.audit().rows(),
    ]
    lines = []
    for name, text, unit, ok in map(audit_row, rows):
        mark, color = MARKS[ok]
        cells = f"{name}</td><td>{html.escape(f'{text} {unit}'.strip())}</td><td style='color: {color}'>{mark}"
        lines.append(f"<tr><td>{cells}</td></tr>")
    title = html.escape(trajectory.scene.model.name)
    hint = "<code>ngalpha_pin.viz.embed(trajectory)</code> shows the motion"
    return f"<table><caption><b>{title}</b></caption><tbody>{''.join(lines)}</tbody></table><p>{hint}</p>"


def audit_row(row: tuple[str, Any, str, bool | None]) -> list[Any]:
    """Name, value as text, unit and verdict of a line of the audit."""
    name, value, unit, ok = row
    text = f"{value:.3g}" if isinstance(value, (float, np.floating)) else str(value)
    return [str(name), text, str(unit or ""), None if ok is None else bool(ok)]
