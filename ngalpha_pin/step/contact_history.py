"""What a state keeps of its contacts, put together and taken apart."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ngalpha_pin.collision.features import VANISHED
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

FIELDS = ("La_N", "la_N", "P_N", "La_F", "la_F", "P_F")


def join_percussions(system: System, first: State, second: State) -> State:
    """The second part of a step with the percussions of both parts."""
    table = system.contacts
    contacts = np.union1d(first.contacts, second.contacts)
    joined: dict[str, Any] = {}
    for name in FIELDS:
        joined[name] = _spread(system, contacts, second, getattr(second, name), "_F" in name)
        if name[0] in "LP":
            joined[name] += _spread(system, contacts, first, getattr(first, name), "_F" in name)
    memory = second.memory
    if memory is not None:
        la_N_bar = _spread(system, contacts, second, memory.la_N_bar, False)
        la_F_bar = _spread(system, contacts, second, memory.la_F_bar, True)
        memory = replace(memory, la_N_bar=la_N_bar, la_F_bar=la_F_bar)
    slots, place = second.slots, first.slots[:, 0]
    # features that carried a force in the first part alone stay, as open contacts
    gone = first.slots[np.isin(place + table.n_fixed, contacts) & ~np.isin(place, slots[:, 0])]
    gone[:, 1 + VANISHED] = system.slots.open_gap
    joined |= {"P_f": second.P_f + first.P_f, "La_b": second.La_b + first.La_b}
    return replace(second, contacts=contacts, slots=np.concatenate((slots, gone)), memory=memory, **joined)


def keep_contacts(system: System, state: State, keep: np.ndarray) -> State:
    """The state with some of its contacts, shape (k,), and nothing of the others."""
    sub, memory = system.contacts.subset(state.contacts), state.memory
    of_F = keep[sub.of_F]
    kept: dict[str, Any] = {name: getattr(state, name)[of_F if "_F" in name else keep] for name in FIELDS}
    if memory is not None:
        memory = replace(memory, la_N_bar=memory.la_N_bar[keep], la_F_bar=memory.la_F_bar[of_F])
    return replace(state, contacts=state.contacts[keep], memory=memory, **kept)


def memory(system: System, state: State, contacts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """La and la_bar of some contacts at the start of the step, normal entries first, shape (k + m,) each."""
    bar = state.auxiliary
    now, then = remembered(system, state, contacts, (state.la_N, state.la_F), (bar.la_N_bar, bar.la_F_bar))
    return now, then


def remembered(
    system: System, state: State, contacts: np.ndarray, *of_state: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """What a state knows of some contacts, all of its own among them: shape (..., k + m), normal entries first.

    Args:
        system: compiled scene.
        state: whose contacts they are.
        contacts: numbers of contacts.
        *of_state: normal and friction entries of the contacts of the state, shapes (k,) and (m,).
    """
    known = np.array([np.concatenate(both) for both in of_state])
    if len(contacts) == len(state.contacts):
        return known
    sub, old = system.contacts.subset(contacts), system.contacts.subset(state.contacts)
    places = np.concatenate((np.searchsorted(sub.index, old.index), sub.k + np.searchsorted(sub.rows_F, old.rows_F)))
    found = np.zeros((len(of_state), sub.k + sub.m))
    found[:, places] = known
    return found


def _spread(system: System, contacts: np.ndarray, state: State, values: np.ndarray, friction: bool) -> np.ndarray:
    """Entries of the contacts of a state in the places of more contacts, zero for the others."""
    all_of, part = system.contacts.subset(contacts), system.contacts.subset(state.contacts)
    full = np.zeros(all_of.m if friction else all_of.k)
    place = np.searchsorted(all_of.rows_F, part.rows_F) if friction else np.searchsorted(all_of.index, part.index)
    full[place] += values
    return full
