"""A run as a table of HTML: what was run, its events and its audit. A notebook shows it, and pages have its lines."""

from __future__ import annotations

import html
from collections import Counter
from typing import TYPE_CHECKING

from ngalpha_pin.results.audit import AuditRow

if TYPE_CHECKING:
    from ngalpha_pin.results.recorded import Recorded

MARKS = {True: ("\N{CHECK MARK}", "#1d8a4e"), False: ("\N{BALLOT X}", "#c8321f"), None: ("", "inherit")}


def summary(trajectory: Recorded) -> str:
    """What was run, its events and its audit, as a table of HTML."""
    kinds = Counter(event.kind for event in trajectory.events)
    rows = [
        AuditRow("method", trajectory.method, "", None),
        AuditRow("time", f"{trajectory.t[0]:g} to {trajectory.t[-1]:g}", "s", None),
        AuditRow("contacts", str(len(trajectory.contact_names)), "", None),
        AuditRow("events", ", ".join(f"{count} {kind}" for kind, count in kinds.items()) or "none", "", None),
        *trajectory.audit().rows(),
    ]
    lines = []
    for name, text, unit, ok in (row.cells() for row in rows):
        mark, color = MARKS[ok]
        cells = f"{name}</td><td>{html.escape(f'{text} {unit}'.strip())}</td><td style='color: {color}'>{mark}"
        lines.append(f"<tr><td>{cells}</td></tr>")
    title = html.escape(trajectory.scene.model.name)
    hint = "<code>ngalpha_pin.viz.embed(trajectory)</code> shows the motion"
    return f"<table><caption><b>{title}</b></caption><tbody>{''.join(lines)}</tbody></table><p>{hint}</p>"
