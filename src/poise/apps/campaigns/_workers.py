"""Workers that run jobs: `LocalWorkers`, processes of this machine, and `ThisProcess`.

`Workers`: what they have in common. `WorkerLostError`: one of them died.
"""

import os
import signal
import threading
import traceback
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, suppress
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from multiprocessing.resource_tracker import ensure_running
from typing import Any, TypeVar
from unittest.mock import patch

from poise._compiled import usable_cores
from poise.errors import ConfigurationError, PoiseError
from poise.sim import silence

T = TypeVar("T")
R = TypeVar("R")

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Linear algebra in workers must not start threads of its own: there is a worker a core."""


class WorkerLostError(Exception):
    """A worker process ended during a job; the message has the reason."""


class Workers(AbstractContextManager["Workers"]):
    """Workers are there inside a `with` block, and gone behind it whatever happened."""

    @property
    @abstractmethod
    def count(self) -> int:
        """Number of jobs in parallel now; raise where no worker is left or expected."""

    @abstractmethod
    def submit(self, function: Callable[[T], R], item: T) -> "Future[tuple[bool, Any]]":
        """Have a worker call `outcome_of`; `WorkerLostError` where it dies meanwhile."""

    def warm(self, function: Callable[[T], bool], item: T) -> None:
        """Call a function once on each machine; here in this process, which runs no episode.

        A worker for which it is true is replaced.
        """
        function(item)

    def each(
        self, function: Callable[[T], R], items: Iterable[T], attempts: int = 3
    ) -> Iterator[tuple[T, R | WorkerLostError]]:
        """Call a function with each of many items, as many at a time as there are workers.

        An item whose worker dies goes to another one, `attempts` times in all: it need not be the
        culprit. Items are taken when a worker is free.
        """
        left, again = iter(items), deque[tuple[T, int]]()
        running: dict[Future[tuple[bool, Any]], tuple[T, int]] = {}
        while True:
            while len(running) < self.count:
                upcoming = again.popleft() if again else next(((i, 1) for i in left), None)
                if upcoming is None:
                    break
                running[self.submit(function, upcoming[0])] = upcoming
            if not running:
                return
            # Workers are counted again each second.
            for future in wait(running, timeout=1.0, return_when=FIRST_COMPLETED).done:
                item, tried = running.pop(future)
                try:
                    raised, result = future.result()
                except WorkerLostError as lost:
                    if tried < attempts:
                        again.append((item, tried + 1))
                        continue
                    raised, result = False, lost
                if raised:
                    raise result
                yield item, result


class ThisProcess(Workers):
    """Everything is done here, one after another, when its turn comes."""

    def __exit__(self, *_: object) -> None:
        """There is nothing to end."""

    @property
    def count(self) -> int:
        """One."""
        return 1

    def submit(self, function: Callable[[T], R], item: T) -> "Future[tuple[bool, Any]]":
        """Call it now; errors end the caller, as a debugger needs it."""
        future: Future[tuple[bool, Any]] = Future()
        future.set_result((False, function(item)))
        return future


class LocalWorkers(Workers):
    """Spawned processes of this machine, one thread each.

    They start when there is something to do, and end with whoever started them, even when that is
    killed. Ctrl-C is for the parent alone. A process that dies, at any time, is replaced.

    Args:
        count: how many; one a core when None.
    """

    def __init__(self, count: int | None = None) -> None:
        count = usable_cores() if count is None else count
        if count < 1:
            raise ConfigurationError("too few workers", got=count, wanted="1 or more")
        self._count = count
        self._processes: list[SpawnProcess] = []
        self._lock = threading.Lock()
        # A thread for each process sends to it, and waits for its answer or its end.
        self._threads: ThreadPoolExecutor | None = None
        self._own = threading.local()

    def __exit__(self, *_: object) -> None:
        """End all processes, whatever they do."""
        with self._lock:
            threads, self._threads = self._threads, None
            for process in self._processes:
                process.kill()
        if threads is not None:
            threads.shutdown(cancel_futures=True)
        while self._processes:
            self._processes.pop().join()

    @property
    def count(self) -> int:
        """Number of processes."""
        return self._count

    def submit(self, function: Callable[[T], R], item: T) -> "Future[tuple[bool, Any]]":
        """Have a process call a function of a module."""
        if self._threads is None:
            self._threads = ThreadPoolExecutor(self._count, initializer=_ignore_ctrl_c)
        return self._threads.submit(self._call, function, item)

    def warm(self, function: Callable[[T], bool], item: T) -> None:
        """Call it here, while the processes come up."""
        for _ in range(self._count):
            self.submit(bool, False)
        super().warm(function, item)

    def _call(self, function: Callable[[T], R], item: T) -> tuple[bool, Any]:
        if not hasattr(self._own, "process"):
            self._own.process, self._own.pipe = self._start()
        with suppress(OSError):  # One that has died shows it in place of an answer.
            self._own.pipe.send((function, item))
        try:
            return self._own.pipe.recv()
        except (EOFError, OSError):
            process = self._own.__dict__.pop("process")
            process.join()
            code = process.exitcode or 0
            end = f"by {signal.Signals(-code).name}" if code < 0 else f"with status {code}"
            raise WorkerLostError(f"its process ended {end}") from None

    def _start(self) -> "tuple[SpawnProcess, Connection]":
        context = get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs,), daemon=True)
        with self._lock, patch.dict(os.environ, dict.fromkeys(_THREADS, "1")):
            if self._threads is None:
                raise WorkerLostError("the workers have been ended")
            process.start()
            self._processes.append(process)
        # Held here as well, its end would never be noticed.
        theirs.close()
        return process, ours


def outcome_of(function: Callable[[T], R], item: T) -> tuple[bool, Any]:
    """In a worker: True if the function raised, with the result or the exception."""
    try:
        return False, function(item)
    except PoiseError as error:
        # Some kinds cannot be made from their text again, as sending does.
        return True, PoiseError(str(error))
    except Exception:
        return True, PoiseError(f"a worker failed: {traceback.format_exc()}")


def _serve(pipe: Connection) -> None:
    """The loop of a process: call the functions sent until the connection closes."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    silence()
    with suppress(EOFError):
        while True:
            function, item = pipe.recv()
            pipe.send(outcome_of(function, item))


def _end_with_parent() -> None:
    """End this process immediately when its parent has ended."""
    parent = parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)


def _ignore_ctrl_c() -> None:
    """Block it in this thread, and so in the processes it starts, while they import already."""
    # It lifts the block as it starts, which it must not do later.
    ensure_running()
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
