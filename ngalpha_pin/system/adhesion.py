"""Contacts that hold a stated force: vacuum cups, magnets, glue.

While such a contact holds, it presses its two bodies onto each other with its adhesion F along the normal, at the point
of contact; la_N >= 0 is what presses between the surfaces, so that la_N - F >= -F is the force of the contact as a
whole and Signorini's law and Coulomb's, |la_F| <= mu la_N, stay as they are. It holds from the moment on at which it
closes and stays closed. It lets go where la_N would become negative, and from then on it has no force until it closes
again: both are solutions of the laws where a load is below F, and what a state remembers tells which one it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ngalpha_pin.common.tolerances import CLOSED
from ngalpha_pin.system.actuation import Actuation

if TYPE_CHECKING:
    from ngalpha_pin.system.state import State
    from ngalpha_pin.system.system import System

# a force this small, in parts of the adhesion, presses no more
LETS_GO = 1e-9
NONE = np.zeros(0, dtype=int)


def sticky(system: System, contacts: np.ndarray) -> np.ndarray:
    """Those of some contacts that have adhesion."""
    return contacts[system.contacts.adhesion[contacts] > 0.0] if system.contacts.adheres else NONE


def holds(actuation: Actuation, holding: np.ndarray) -> Actuation:
    """What acts where these contacts hold and no others."""
    return actuation._replace(holding=holding if len(holding) else None)


def lets_go(system: System, state: State) -> np.ndarray:
    """Contacts that hold up to a state and do not press in it any more."""
    if not len(state.holding):
        return state.holding
    presses = state.la_N > LETS_GO * system.contacts.adhesion[state.contacts]
    if len(state.la_N) and not state.la_N.any():  # percussions may do all of the work of forces
        system.dynamics(state.t, state.q, state.v, state.a, state.actuation)
        sub = system.contacts.subset(state.contacts)
        rows = system.contact_rows(sub, state.q, state.v, state.a, state.t)
        slowest = CLOSED * max(rows.sizes[1], system.contacts.speed)
        stays = (rows.rate[: sub.k] <= slowest) & (rows.acceleration[: sub.k] < 0.0)
        presses = stays & (state.P_N > 0.0)
    return np.setdiff1d(state.holding, state.contacts[presses])
