"""`DaskWorkers`: the processes of a Dask cluster. `SlurmWorkers`: one made of Slurm's jobs."""

import logging
import shutil
from collections.abc import Callable
from contextlib import suppress
from importlib import metadata
from pathlib import Path
from queue import Empty, Queue
from time import monotonic
from typing import Any, Literal, TypeVar

from poise.apps.campaigns._episode import version
from poise.apps.campaigns._workers import WorkerLostError, Workers, portable
from poise.errors import ConfigurationError, MissingExtraError, PoiseError

T = TypeVar("T")
R = TypeVar("R")

_PATIENCE = 10.0
"""A scheduler that does not answer for this long is not there [s]."""

_WITHOUT_WORKER = 3600.0
"""How long there may be no worker: jobs of Slurm have to wait for their turn [s]."""

_LONGEST_JOB = 24 * 60
"""Limit of a job of Slurm's, where SBATCH_TIMELIMIT says no other [min]."""

_LOOK = 1.0
"""How often is looked whether the scheduler is still there, while nothing comes [s]."""


class DaskWorkers(Workers):
    """The worker processes of a Dask cluster, however many there are at the moment.

    A worker that dies is the scheduler's business: it gives the episode to another one, and says so
    after three deaths (its setting `allowed-failures`).
    """

    def __init__(self, address: str) -> None:
        self._address = address
        self._client: Any = None
        self._tickets: dict[Any, int] = {}
        self._ended: Queue[Any] = Queue()

    def __enter__(self) -> "DaskWorkers":
        distributed = _distributed()
        # Its own tracebacks of connections that are lost; what they mean is said by an error.
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        try:
            self._client = distributed.Client(
                self._address, timeout=_PATIENCE, set_as_default=False
            )
        except (OSError, ValueError, TypeError) as error:
            raise ConfigurationError(
                f"no scheduler there ({_reason(error)})",
                got=self._address,
                wanted="the address that `dask scheduler` prints",
            ) from None
        try:
            self._client.wait_for_workers(1, timeout=_WITHOUT_WORKER)
            self._check_poise()
        except TimeoutError:
            self.__exit__()
            raise PoiseError("the cluster has no worker", got=self._address) from None
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        if self._client is not None:
            self._client.close(timeout=_PATIENCE)
            self._client = None

    @property
    def free(self) -> int:
        """How many more things they take now: what waits at a worker that dies is tried anew."""
        return max(len(self._workers()), 1) - len(self._tickets)

    def submit(self, ticket: int, function: Callable[[T], R], item: T) -> None:
        """Has a worker call a function of a module."""
        future = self._client.submit(_called, function, item, pure=False)
        self._tickets[future] = ticket
        future.add_done_callback(self._ended.put)

    def wait(self) -> list[tuple[int, Any]]:
        """Waits until some calls have come to an end."""
        alone = monotonic() + _WITHOUT_WORKER
        while True:
            try:
                future = self._ended.get(timeout=_LOOK)
            except Empty:
                if self._workers():
                    alone = monotonic() + _WITHOUT_WORKER
                elif monotonic() > alone:
                    raise PoiseError("the cluster has no worker any more") from None
                continue
            return [(self._tickets.pop(future), self._result(future))]

    def warm(self, function: Callable[[T], bool], item: T) -> None:
        """Calls a function in one worker of each machine: they share what it compiles."""
        of_hosts = {about["host"]: address for address, about in self._workers().items()}
        calls = {
            address: self._client.submit(_called, function, item, pure=False, workers=[address])
            for address in of_hosts.values()
        }
        used_up = {address: self._result(call) for address, call in calls.items()}
        for found in used_up.values():
            if isinstance(found, WorkerLostError):
                raise PoiseError(f"the first episode cannot be begun: {found}")
        with suppress(ValueError):  # A worker without a nanny cannot be started anew.
            # One that does not come back is gone, and the others do its share.
            self._client.restart_workers(
                [a for a, used in used_up.items() if used], raise_for_error=False
            )

    def _workers(self) -> dict[str, Any]:
        """What the scheduler says of each worker, by address."""
        known = self._client.scheduler_info(n_workers=-1)
        self._check_scheduler()
        return known["workers"]

    def _result(self, future: Any) -> Any:
        from distributed.scheduler import KilledWorker

        try:
            raised, result = future.result()
        except KilledWorker as error:
            return WorkerLostError(f"it ended {error.allowed_failures + 1} workers")
        except Exception as error:
            self._check_scheduler()
            raise PoiseError(f"a worker of the cluster failed ({_reason(error)})") from None
        if raised:
            raise result
        return result

    def _check_poise(self) -> None:
        """Sees that workers have Poise: one without leaves the cluster when it gets an episode.

        Whether it is the same Poise each episode sees for itself.
        """
        # Nothing of Poise is sent for this, only a name of Python's own library.
        found = self._client.run(metadata.version, "poise", on_error="return")
        for worker, answer in found.items():
            if isinstance(answer, metadata.PackageNotFoundError):
                raise PoiseError(f"worker {worker} has no Poise", wanted=version())

    def _check_scheduler(self) -> None:
        if self._client.status != "running":
            raise PoiseError("the scheduler is not there any more", got=self._address)


class SlurmWorkers(DaskWorkers):
    """Workers that are jobs of Slurm, for as long as they are needed.

    The scheduler is in this process; jobs connect to it over the cluster's network.
    """

    def __init__(
        self,
        count: int,
        logs: str | Path = "runs/slurm",
        executor: Literal["slurm", "local"] = "slurm",
    ) -> None:
        super().__init__("")
        self._count, self._logs, self._executor = count, logs, executor
        self._cluster: Any = None
        self._jobs: list[Any] = []

    def __enter__(self) -> "SlurmWorkers":
        if self._executor == "slurm" and shutil.which("sbatch") is None:
            raise ConfigurationError("no Slurm on this machine", got="no command sbatch")
        distributed = _distributed()
        try:
            import submitit
        except ImportError:
            raise MissingExtraError("submitit", "campaign", "--slurm") from None
        self._cluster = distributed.LocalCluster(
            n_workers=0,
            host="0.0.0.0" if self._executor == "slurm" else "127.0.0.1",
            dashboard_address="127.0.0.1:0",
        )
        try:
            executor = submitit.AutoExecutor(folder=self._logs, cluster=self._executor)
            executor.update_parameters(
                name="poise", cpus_per_task=1, tasks_per_node=1, timeout_min=_LONGEST_JOB
            )
            address = self._cluster.scheduler_address
            self._address = address
            self._jobs = executor.map_array(serve, [address] * self._count)
            super().__enter__()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        for job in self._jobs:
            job.cancel()
        self._jobs = []
        if self._cluster is not None:
            self._cluster.close()
            self._cluster = None


def serve(address: str) -> None:
    """Job of Slurm: works for a scheduler until that is gone."""
    import asyncio

    async def work() -> None:
        # The nanny starts another process in place of one that has died.
        async with _distributed().Nanny(address, nthreads=1, death_timeout=_PATIENCE) as nanny:
            await nanny.finished()

    asyncio.run(work())


def _called(function: Callable[[T], R], item: T) -> tuple[bool, Any]:
    """In a worker: whether the function raised, and what it returned or raised."""
    try:
        return False, function(item)
    except PoiseError as error:
        return True, portable(error)


def _distributed() -> Any:
    try:
        import distributed
    except ImportError:
        raise MissingExtraError("distributed", "campaign", "a cluster") from None
    return distributed


def _reason(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())
