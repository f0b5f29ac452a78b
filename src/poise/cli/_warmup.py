"""`poise warmup`: compile the functions of controllers before the first use."""

import os
from dataclasses import asdict, dataclass

from tyro.conf import UseAppendAction

from poise._progress import Bar
from poise.cli._command import Figures
from poise.control import CONTROLLERS, usable_cores, warm_up
from poise.locomotion import StepTeleoperator
from poise.robots import load_robot


@dataclass(frozen=True, kw_only=True)
class WarmupVerb(Figures):
    """Compile what controllers and step teleoperation need, for images, robots and CI.

    Otherwise the first ones on a machine do it, which takes some thirty seconds. It is kept for
    this kind of processor, beside the sources where they can be written, else in the user's cache
    folder, or in the folder that NUMBA_CACHE_DIR names. Exit status: 0 all is compiled and kept, 2
    it cannot be kept.

    example: poise warmup --controller whole_body

    Attributes:
        controller: compile for this one alone, of whole_body, reduced, osf, differential_ik; may
            be given several times.
    """

    controller: UseAppendAction[tuple[str, ...]] = ()

    def act(self) -> int:
        """Compile, with a bar on a terminal."""
        controllers = tuple(dict.fromkeys(self.controller or CONTROLLERS))
        if not self.json:
            cores = usable_cores()
            print(f"compiling for {', '.join(controllers)}; cores: {cores}", flush=True)
        with Bar("compiling", " functions", lines=False) as bar:
            done = warm_up(
                controllers,
                others=[lambda: StepTeleoperator(load_robot("humanoid33"))],
                note=lambda done, total: bar(float(done), float(total)),
            )
        processor = sum(os.times()[:4])
        row = f"nothing to compile: all is kept in {done.folder}"
        if done.functions:
            row = (
                f"compiled {done.functions} functions in {done.seconds:.1f} s "
                f"({processor:.1f} s of processor time), kept in {done.folder}"
            )
        return self.show({**asdict(done), "processor_s": processor}, row)
