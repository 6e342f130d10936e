"""What a run whose scene changed says of itself: each part by its own scene, put together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import wraps
from typing import Any, TypeVar

import numpy as np

from ngalpha_pin.results.audit import Audit
from ngalpha_pin.results.energy_audit import EnergyVerdict

Method = TypeVar("Method", bound=Callable[..., Any])


def by_parts(method: Method) -> Method:
    """A method of a run that gives arrays over time: of one with parts, theirs one after the other."""

    @wraps(method)
    def one_after_the_other(self: Any, *args: Any, **kwargs: Any) -> Any:
        parts = self._run.parts
        if not parts:
            return method(self, *args, **kwargs)
        return in_line([method(part, *args, **kwargs) for part in parts])

    return one_after_the_other  # type: ignore[return-value]


def in_line(found: Sequence[Any]) -> Any:
    """Arrays over time, or tuples of them, one after the other; of a moment between two the first has it."""
    if isinstance(found[0], np.ndarray):
        return np.concatenate([array[i > 0 :] for i, array in enumerate(found)])
    return type(found[0])(*(in_line(arrays) if isinstance(arrays[0], np.ndarray) else all(arrays)
                            for arrays in zip(*found, strict=True)))  # fmt: skip


def worst(audits: Sequence[Audit], change: float, message: str) -> Audit:
    """The worst of the audits of the parts of a run.

    Args:
        audits: of the parts.
        change: of the energy over the whole run [J].
        message: how it ended.
    """
    found: dict[str, Any] = {}
    for field in fields(Audit):
        values = [getattr(audit, field.name) for audit in audits]
        if field.name == "energy":
            found["energy"] = _energy(values)._replace(change=change)
        elif field.name == "rank":
            found["rank"] = min(values, key=lambda pair: pair[0] - pair[1])
        elif field.name == "rungs":
            found["rungs"] = dict(sum((Counter(value) for value in values), Counter()))
        elif field.name in ("finite", "success"):
            found[field.name] = all(values)
        elif field.name == "chosen":
            found["chosen"] = ()
        elif field.name == "n_steps":
            found["n_steps"] = sum(values)
        elif field.name == "n_iter_mean":
            steps = [audit.n_steps for audit in audits]
            found[field.name] = float(np.average(values, weights=steps)) if sum(steps) else 0.0
        elif field.name != "message":
            found[field.name] = None if None in values else np.max(values).item()
    return Audit(**found, message=message)


def _energy(verdicts: Sequence[EnergyVerdict]) -> EnergyVerdict:
    """The worst of some verdicts."""
    worst = max(verdicts, key=lambda verdict: verdict.left_over)
    closes, falls = (
        None if None in values else all(values)
        for values in ([v.closes for v in verdicts], [v.falls for v in verdicts])
    )
    rise, gain = (max(getattr(v, name) for v in verdicts) for name in ("rise", "gain"))
    return worst._replace(closes=closes, falls=falls, rise=rise, gain=gain)
