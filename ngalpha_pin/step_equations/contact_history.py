"""What a state keeps of its contacts, put together and taken apart."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ngalpha_pin.collision.features import VANISHED
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

FIELDS = ("kappa_N", "La_N", "la_N", "la_N_bar", "P_N", "La_F", "la_F", "la_F_bar", "P_F")


def join_percussions(system: System, first: State, second: State) -> State:
    """The second part of a step with the percussions of both parts."""
    table = system.contacts
    contacts = np.union1d(first.contacts, second.contacts)
    both = table.subset(contacts)
    joined: dict[str, Any] = {name: np.zeros(both.m if "_F" in name else both.k) for name in FIELDS}
    for state, names in ((first, ("La_N", "P_N", "La_F", "P_F")), (second, FIELDS)):
        part = table.subset(state.contacts)
        N, F = np.searchsorted(both.index, part.index), np.searchsorted(both.rows_F, part.rows_F)
        for name in names:
            joined[name][F if "_F" in name else N] += getattr(state, name)
    slots, place = second.slots, first.slots[:, 0]
    # features that carried a force in the first part alone stay, as open contacts
    gone = first.slots[np.isin(place + table.n_fixed, contacts) & ~np.isin(place, slots[:, 0])]
    gone[:, 1 + VANISHED] = system.slots.open_gap
    both_P, both_La = second.P_f + first.P_f, second.La_b + first.La_b
    return replace(second, contacts=contacts, slots=np.concatenate((slots, gone)), P_f=both_P, La_b=both_La, **joined)


def keep_contacts(system: System, state: State, keep: np.ndarray) -> State:
    """The state with some of its contacts, shape (k,), and nothing of the others."""
    sub = system.contacts.subset(state.contacts)
    of_F = keep[sub.of_F]
    kept: dict[str, Any] = {name: getattr(state, name)[of_F if "_F" in name else keep] for name in FIELDS}
    return replace(state, contacts=state.contacts[keep], **kept)


def memory(system: System, state: State, contacts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """La and la_bar of some contacts at the start of the step, normal entries first, shape (k + m,) each."""
    now, bar = remembered(system, state, contacts, ("la_N", "la_F"), ("la_N_bar", "la_F_bar"))
    return now, bar


def remembered(system: System, state: State, contacts: np.ndarray, *fields: tuple[str, str]) -> np.ndarray:
    """What a state knows of some contacts, all of its own among them: shape (fields, k + m), normal entries first."""
    known = np.array([np.concatenate((getattr(state, N), getattr(state, F))) for N, F in fields])
    if len(contacts) == len(state.contacts):
        return known
    sub, old = system.contacts.subset(contacts), system.contacts.subset(state.contacts)
    places = np.concatenate((np.searchsorted(sub.index, old.index), sub.k + np.searchsorted(sub.rows_F, old.rows_F)))
    found = np.zeros((len(fields), sub.k + sub.m))
    found[:, places] = known
    return found
