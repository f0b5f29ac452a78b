"""`FaultLog`: what goes wrong with devices, said once a kind."""

import logging

from poise.locomotion._stepping._operator._fields import FieldError

_LOG = logging.getLogger("poise")


class FaultLog:
    """Says on the logger `poise` what goes wrong, each kind once.

    There are hundreds of ticks a second, and what fails in one mostly fails in the next; what does
    so now and then has been said, too. A kind is a class of exceptions, and of a `FieldError` a
    field.
    """

    def __init__(self) -> None:
        self._said = set[tuple[type[Exception], str]]()

    def say(self, error: Exception, what: str, *names: str) -> None:
        """Says it, unless all of its kinds have been said.

        Args:
            error: with its traceback.
            what: comes of it, as a format of the logger's.
            names: for the format.
        """
        fields = error.fields if isinstance(error, FieldError) else ("",)
        kinds = {(type(error), field) for field in fields}
        if not kinds <= self._said:
            self._said |= kinds
            _LOG.error(what, *names, exc_info=error)

    def clear(self) -> None:
        """Nothing has been said yet."""
        self._said.clear()
