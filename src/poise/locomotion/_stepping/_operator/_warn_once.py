"""`WarnOnce`: logs each kind of fault of a device once."""

import logging

from poise.locomotion._stepping._operator._fields import FieldError

_LOG = logging.getLogger("poise")


class WarnOnce:
    """Log faults on the logger `poise`, each kind once: most recur in the next tick.

    A kind is a class of exceptions, and of a `FieldError` a field.
    """

    def __init__(self) -> None:
        self._logged = set[tuple[type[Exception], str]]()

    def __call__(self, error: Exception, message: str, *names: str) -> None:
        """Log an error with its traceback, unless all of its kinds have been logged.

        Args:
            error: what happened.
            message: what follows from it, a format of the logger's.
            names: for the format.
        """
        fields = error.fields if isinstance(error, FieldError) else ("",)
        kinds = {(type(error), field) for field in fields}
        if not kinds <= self._logged:
            self._logged |= kinds
            _LOG.error(message, *names, exc_info=error)

    def clear(self) -> None:
        """Log every kind once more."""
        self._logged.clear()
