"""`DaskWorkers`: the processes of a Dask cluster. `SlurmWorkers`: one of Slurm jobs."""

import gc
import logging
import shutil
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import ExitStack, suppress
from importlib import metadata
from pathlib import Path
from time import monotonic
from typing import Any, Literal, TypeVar

from poise.apps.campaigns._episode import version
from poise.apps.campaigns._workers import WorkerLostError, Workers, outcome_of
from poise.errors import ConfigurationError, PoiseError, import_extra

T = TypeVar("T")
R = TypeVar("R")


class DaskWorkers(Workers):
    """The worker processes of a Dask cluster, however many there are at the moment.

    The scheduler gives the episode of a worker that dies to another one, and gives it up after
    three deaths (its setting `allowed-failures`).

    Args:
        address: of its scheduler.
        patience: a scheduler that does not answer for this long is not there [s].
        alone: there may be no worker for so long: jobs of Slurm wait for their turn [s].
    """

    def __init__(self, address: str, *, patience: float = 10.0, alone: float = 3600.0) -> None:
        self._address, self._patience, self._most_alone = address, patience, alone
        self._client: Any = None
        self._alone = 0.0

    def __enter__(self) -> "DaskWorkers":
        distributed = _distributed()
        # Tracebacks of lost connections, which are reported as an error.
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        refused = None
        try:
            self._client = distributed.Client(
                self._address, timeout=self._patience, set_as_default=False
            )
        except (OSError, ValueError, TypeError) as error:
            refused = _reason(error)
        if refused is not None:
            # Free the client that did not connect: in the thread of the next one, it deadlocks.
            gc.collect()
            raise ConfigurationError(
                f"no scheduler there ({refused})",
                got=self._address,
                wanted="the address that `dask scheduler` prints",
            )
        with ExitStack() as ends_where_this_fails:
            ends_where_this_fails.callback(self.__exit__)
            try:
                self._client.wait_for_workers(1, timeout=self._most_alone)
            except TimeoutError:
                raise PoiseError("the cluster has no worker", got=self._address) from None
            self._check_poise()
            self._alone = monotonic() + self._most_alone
            ends_where_this_fails.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        if self._client is not None:
            self._client.close(timeout=self._patience)
            self._client = None

    @property
    def count(self) -> int:
        """Number of workers now; one where more may come."""
        count = len(self._workers())
        if count > 0:
            self._alone = monotonic() + self._most_alone
        elif monotonic() > self._alone:
            raise PoiseError("the cluster has no worker any more")
        return max(count, 1)

    def submit(self, function: Callable[[T], R], item: T) -> "Future[tuple[bool, Any]]":
        """Have a worker call a function of a module."""
        answer: Future[tuple[bool, Any]] = Future()
        call = self._client.submit(outcome_of, function, item, pure=False)
        call.add_done_callback(lambda call: self._settle(answer, call))
        return answer

    def warm(self, function: Callable[[T], bool], item: T) -> None:
        """Call a function in one worker of each machine: they share what it compiles."""
        one_a_host = {about["host"]: address for address, about in self._workers().items()}
        # Beside the scheduler: a worker that dies takes nothing along, and the others go on.
        found = self._client.run(
            _beside, function, item, workers=[*one_a_host.values()], on_error="return"
        )
        outcomes = {worker: found[worker] for worker in found if isinstance(found[worker], tuple)}
        for raised, result in outcomes.values():
            if raised:
                raise result
        used_up = {worker for worker, (_, compiled) in outcomes.items() if compiled}
        with suppress(ValueError):  # A worker without a nanny cannot be restarted.
            # A worker that does not return is lost, and the others take over its jobs.
            self._client.restart_workers([*used_up & {*self._workers()}], raise_for_error=False)

    def _settle(self, answer: "Future[tuple[bool, Any]]", call: Any) -> None:
        """Pass the result of a call on."""
        from distributed.scheduler import KilledWorker

        try:
            answer.set_result(call.result())
        except KilledWorker as error:
            lost = WorkerLostError(f"it ended {error.allowed_failures + 1} workers")
            answer.set_exception(lost)
        except Exception as error:
            failed = PoiseError(f"a worker of the cluster failed ({_reason(error)})")
            answer.set_exception(self._gone() or failed)

    def _workers(self) -> dict[str, Any]:
        """Facts of each worker, by address."""
        known = self._client.scheduler_info(n_workers=-1)
        if gone := self._gone():
            raise gone
        return known["workers"]

    def _gone(self) -> PoiseError | None:
        if self._client is not None and self._client.status == "running":
            return None
        return PoiseError("the scheduler is not there any more", got=self._address)

    def _check_poise(self) -> None:
        """Refuse workers without Poise: one leaves the cluster when it gets an episode.

        Whether it is the same Poise each episode checks for itself.
        """
        # Nothing of Poise is sent for this, only a name of Python's own library.
        found = self._client.run(metadata.version, "poise", on_error="return")
        for worker, answer in found.items():
            if isinstance(answer, metadata.PackageNotFoundError):
                raise PoiseError(f"worker {worker} has no Poise", wanted=version())


class SlurmWorkers(DaskWorkers):
    """Workers that are jobs of Slurm, for as long as they are needed.

    The scheduler is in this process; jobs connect to it over the cluster's network.

    Args:
        count: number of jobs.
        logs: folder of what they print.
        executor: "local" for processes here.
    """

    def __init__(
        self,
        count: int,
        logs: str | Path = "runs/slurm",
        executor: Literal["slurm", "local"] = "slurm",
    ) -> None:
        super().__init__("")
        self._count, self._logs, self._executor = count, logs, executor
        self._ends = ExitStack()

    def __enter__(self) -> "SlurmWorkers":
        if self._executor == "slurm" and shutil.which("sbatch") is None:
            raise ConfigurationError("no Slurm on this machine", got="no command sbatch")
        distributed = _distributed()
        submitit = import_extra("submitit", "campaign", "--slurm")
        with ExitStack() as ends:
            cluster = distributed.LocalCluster(
                n_workers=0,
                host="0.0.0.0" if self._executor == "slurm" else "127.0.0.1",
                dashboard_address="127.0.0.1:0",
            )
            ends.callback(cluster.close)
            self._address = cluster.scheduler_address
            executor = submitit.AutoExecutor(folder=self._logs, cluster=self._executor)
            # A day, unless SBATCH_TIMELIMIT is set.
            executor.update_parameters(
                name="poise", cpus_per_task=1, tasks_per_node=1, timeout_min=24 * 60
            )
            for job in executor.map_array(serve, [self._address] * self._count):
                ends.callback(job.cancel)
            super().__enter__()
            self._ends = ends.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        self._ends.close()


def serve(address: str) -> None:
    """Slurm job: a worker of a scheduler, until the scheduler ends."""
    import asyncio

    async def work() -> None:
        # The nanny starts another process in place of one that has died.
        async with _distributed().Nanny(address, nthreads=1, death_timeout=10.0) as nanny:
            await nanny.finished()

    asyncio.run(work())


async def _beside(function: Callable[[T], R], item: T) -> tuple[bool, Any]:
    """In a worker: call a function in a thread, so that the worker still answers."""
    import asyncio

    return await asyncio.to_thread(outcome_of, function, item)


def _distributed() -> Any:
    return import_extra("distributed", "campaign", "a cluster")


def _reason(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())
