"""`LocalWorkers`: processes of this machine that work through jobs; what any workers can do.

`Workers`: processes here, or a cluster. `WorkerLostError`: one of them has gone.
"""

import os
import signal
import threading
import traceback
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from multiprocessing.resource_tracker import ensure_running
from typing import Any, TypeVar

from poise._compiled import usable_cores
from poise.errors import ConfigurationError, PoiseError
from poise.sim import silence

T = TypeVar("T")
R = TypeVar("R")

ATTEMPTS = 3
"""How often something is tried that takes its worker along: it need not be the culprit."""

_TICKETS = count()
"""Of all calls of this process, so that none is taken for another."""

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Linear algebra in workers must not start threads of its own: there is a worker a core."""


class WorkerLostError(Exception):
    """A worker ended in the middle of something; the text says how."""


class Workers(ABC):
    """Processes that each do one thing at a time.

    A context manager: they are there inside, and gone behind it whatever happened.
    """

    @property
    @abstractmethod
    def free(self) -> int:
        """How many more things they take now."""

    @abstractmethod
    def submit(self, ticket: int, function: Callable[[T], R], item: T) -> None:
        """Has a worker call a function of a module."""

    @abstractmethod
    def wait(self) -> list[tuple[int, Any]]:
        """Waits until some calls have come to an end."""

    @abstractmethod
    def warm(self, function: Callable[[T], bool], item: T) -> None:
        """Calls a function once on each machine, before anything else is done there."""

    @abstractmethod
    def __enter__(self) -> "Workers": ...

    @abstractmethod
    def __exit__(self, *_: object) -> None: ...

    def each(
        self, function: Callable[[T], R], items: Iterable[T], attempts: int = ATTEMPTS
    ) -> Iterator[tuple[T, R | WorkerLostError]]:
        """Calls a function with each of many items, as many at a time as there are workers.

        An item whose worker dies is given to another one, `attempts` times in all.
        """
        left, again = iter(items), deque[tuple[T, int]]()
        running: dict[int, tuple[T, int]] = {}
        while True:
            while self.free > 0:
                upcoming = again.popleft() if again else next(((i, 1) for i in left), None)
                if upcoming is None:
                    break
                ticket = next(_TICKETS)
                running[ticket] = upcoming
                self.submit(ticket, function, upcoming[0])
            if not running:
                return
            for done, result in self.wait():
                if done not in running:
                    # What is left of calls that an error has ended early.
                    continue
                item, tried = running.pop(done)
                if isinstance(result, WorkerLostError) and tried < attempts:
                    again.append((item, tried + 1))
                else:
                    yield item, result


class LocalWorkers(Workers):
    """Spawned processes of this machine, one thread each.

    They start when there is something to do, and end with whoever started them, even when that is
    killed. Ctrl-C is for the parent alone.

    Args:
        count: how many; one a core when None.
    """

    def __init__(self, count: int | None = None) -> None:
        count = usable_cores() if count is None else count
        if count < 1:
            raise ConfigurationError("too few workers", got=count, wanted="1 or more")
        self._count = count
        self._idle: list[_Worker] = []
        self._busy: dict[_Worker, int] = {}

    def __enter__(self) -> "LocalWorkers":
        return self

    def __exit__(self, *_: object) -> None:
        for worker in (*self._idle, *self._busy):
            worker.stop()
        self._idle, self._busy = [], {}

    @property
    def free(self) -> int:
        """How many more things they take now."""
        return self._count - len(self._busy)

    @property
    def pids(self) -> tuple[int, ...]:
        """Ids of the processes that there are now."""
        return tuple(worker.pid for worker in (*self._idle, *self._busy))

    def submit(self, ticket: int, function: Callable[[T], R], item: T) -> None:
        """Has a worker call a function of a module."""
        worker = self._idle.pop() if self._idle else _Worker()
        self._busy[worker] = ticket
        worker.ask(function, item)

    def wait(self) -> list[tuple[int, Any]]:
        """Waits until some calls have come to an end."""
        by_pipe: dict[Any, _Worker] = {worker.pipe: worker for worker in self._busy}
        ended: list[tuple[int, Any]] = []
        for pipe in wait(list(by_pipe)):
            worker = by_pipe[pipe]
            ticket = self._busy.pop(worker)
            self._idle.append(worker)
            try:
                ended.append((ticket, worker.answer()))
            except WorkerLostError as reason:
                self._idle.remove(worker)
                ended.append((ticket, reason))
        return ended

    def warm(self, function: Callable[[T], bool], item: T) -> None:
        """Calls a function in one worker, while the others come up."""
        while len(self._idle) + len(self._busy) < self._count:
            self._idle.append(_Worker())
        ((_, used_up),) = self.each(function, [item], attempts=1)
        if isinstance(used_up, WorkerLostError):
            raise PoiseError(f"the first episode cannot be begun: {used_up}")
        if used_up:
            self._idle.pop().stop()


class _Worker:
    """One process and the pipe to it."""

    def __init__(self) -> None:
        context = get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,), daemon=True)
        with _one_thread_each(), _deaf_to_ctrl_c():
            self._process.start()
        # Held here as well, its end would never be noticed.
        theirs.close()

    @property
    def pid(self) -> int:
        """Its number."""
        return self._process.pid or 0

    def ask(self, function: Callable[[Any], Any], item: Any) -> None:
        """Sends it something to do; one that has died meanwhile says so when it is to answer."""
        with suppress(OSError):
            self.pipe.send((function, item))

    def answer(self) -> Any:
        """Return its answer."""
        try:
            raised, result = self.pipe.recv()
        except (EOFError, OSError):
            self.pipe.close()
            self._process.join()
            raise WorkerLostError(_how(self._process.exitcode)) from None
        if raised:
            raise result
        return result

    def stop(self) -> None:
        """Ends it at once, whatever it does."""
        self._process.kill()
        self._process.join()
        self.pipe.close()


def _how(exitcode: int | None) -> str:
    """How a process ended."""
    if exitcode is not None and exitcode < 0:
        return f"its process was ended by {signal.Signals(-exitcode).name}"
    return f"its process ended with status {exitcode}"


def _serve(pipe: Connection) -> None:
    """What a worker does: calls what it is asked for, until nobody asks any more."""
    # Ctrl-C in a terminal reaches all processes; the parent ends this one when it is to end.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    silence()
    while True:
        try:
            function, item = pipe.recv()
        except EOFError:
            return
        try:
            said = (False, function(item))
        except PoiseError as error:
            said = (True, portable(error))
        except Exception:
            said = (True, PoiseError(f"a worker failed: {traceback.format_exc()}"))
        pipe.send(said)


def portable(error: PoiseError) -> PoiseError:
    """An error that can be sent to another process: some cannot be made from their text again."""
    return PoiseError(str(error))


def _end_with_parent() -> None:
    """Ends this process when its parent is gone, in the middle of whatever it does."""
    parent = parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)


@contextmanager
def _deaf_to_ctrl_c() -> Generator[None]:
    """What starts meanwhile hears no Ctrl-C while it imports, before it can say so by itself."""
    # It lifts the mask as it starts, which it must not do in between.
    ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _one_thread_each() -> Generator[None]:
    """Processes inherit the environment."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
