"""The link to a G1: deployments, faults, kills, the wire, preflight, vibration and balance."""

from studies.g1_link._balance import balance_section
from studies.g1_link._faults import faults_section
from studies.g1_link._kill import kill_section
from studies.g1_link._loops import loops_section
from studies.g1_link._preflight import preflight_section
from studies.g1_link._real_time import real_time_section
from studies.g1_link._vibration import vibration_section
from studies.g1_link._wire import wire_section
from studies.plan import Part, StudyPlan

PLAN = StudyPlan(
    name="g1-link",
    title="The way to a Unitree G1",
    introduction=(
        "All that stands between a controller and the drives of a G1, with a simulated robot at "
        "the other end: motors with friction, ripple and delay, a bus that loses and delays, a "
        "computer that is late, dies or has no answer, and people who wire it wrongly.",
    ),
    source="No paper; the bounds are those that Poise sets itself.",
    parts=(
        Part("loops", "Deployments with motors, noise, delays, loss and jitter", loops_section),
        Part("real-time", "Robot and controller in real time over DDS", real_time_section),
        Part("kill", "A controller that is killed as the robot walks", kill_section),
        Part("faults", "Random faults and the response to each", faults_section),
        Part("wire", "Commands and the checksum on the wire", wire_section),
        Part("preflight", "Mistakes that the preflight has to find", preflight_section),
        Part("vibration", "Vibration by motors, delay and gains", vibration_section),
        Part("balance", "Arms that swing under the balance service", balance_section),
    ),
)
"""The study."""
