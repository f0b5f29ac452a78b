"""`ContactSets`: what is prepared for each set of active contacts, and which are, ahead of time."""

from collections.abc import Callable, Iterator
from itertools import chain, combinations
from typing import Generic, TypeVar

from poise.stack._contact import Contact
from poise.stack._stack import Stack

PREPARED_CONTACTS = 3
"""Stacks of up to so many contacts have all their sets prepared before the first tick."""

T = TypeVar("T")


class ContactSets(Generic[T]):
    """Objects made once for each set of active contacts: switching back allocates nothing.

    The active contacts are prepared when this is made; where there are few contacts, all their
    sets are, so that no tick has to make one. What is wrong is so refused before the first tick.
    """

    def __init__(self, stack: Stack, make: Callable[[tuple[Contact, ...]], T]) -> None:
        self._make = make
        self._made: dict[tuple[Contact, ...], T] = {}
        contacts = stack.contacts
        sets = {stack.active_contacts}
        if len(contacts) <= PREPARED_CONTACTS:
            sizes = range(len(contacts) + 1)
            sets.update(chain.from_iterable(combinations(contacts, k) for k in sizes))
        for contacts in sets:
            self.of(contacts)

    def of(self, contacts: tuple[Contact, ...]) -> T:
        """Return the object of a set of contacts, given in the order of the stack."""
        made = self._made.get(contacts)
        if made is None:
            made = self._made[contacts] = self._make(contacts)
        return made

    @property
    def sets(self) -> tuple[tuple[Contact, ...], ...]:
        """The sets that something was made for."""
        return tuple(self._made)

    def __iter__(self) -> Iterator[T]:
        """All that was made."""
        return iter(self._made.values())

    def __len__(self) -> int:
        """Number of sets."""
        return len(self._made)
