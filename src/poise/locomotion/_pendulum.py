"""`BodyRotator`: angular momentum that makes up for what the cart-table model lacks.

`CartFlywheelTable`: the smallest model of a biped whose ZMP one controls.
`ZmpRegulator`: the dual of the COM shifter, from COM reference to ZMP.
`ComShifter`: moves the centre of mass so that the ZMP gets where it should, soon.
"""

import math

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise.errors import ConfigurationError
from poise.robots import GRAVITY


def natural_frequency(height: float, gravity: float = GRAVITY) -> float:
    """Omega = sqrt(g / H) [1/s].

    Args:
        height: of the table, which is the height of the COM [m].
        gravity: [m/s^2].

    Raises:
        ConfigurationError: not positive.
    """
    checked_number(height, "height of the table [m]", above=0.0)
    return math.sqrt(checked_number(gravity, "gravity of the table [m/s^2]", above=0.0) / height)


class CartFlywheelTable:
    """Cart and flywheel on a table, eq. (24) of Zhang and Kikuuwe, in as many axes as `p` has.

        pdd = u_1,   Ldot = u_2,   r = p - u_1 / omega^2 - u_2 / W

    p is the COM, r the ZMP, L the angular momentum about the COM in the sense that moves the ZMP
    back (for a robot that walks along x, L is -L_Gx for the axis y and L_Gy for the axis x). With
    u_2 = 0 it is the cart-table model.

    Args:
        height: of the table [m].
        mass: of the cart [kg].
        position: p at the start [m].
        gravity: [m/s^2].

    Raises:
        ConfigurationError: not positive.

    Attributes:
        omega: sqrt(g / H) [1/s].
        weight: W = m g [N].
        position: p [m].
        velocity: pdot [m/s].
        momentum: L [kg m^2/s].
        zmp: r under the last inputs [m].
    """

    def __init__(
        self,
        height: float,
        mass: float,
        position: Float64[np.ndarray, " n"],
        gravity: float = GRAVITY,
    ) -> None:
        self.omega = natural_frequency(height, gravity)
        self.weight = checked_number(mass, "mass of the cart [kg]", above=0.0) * gravity
        self.position = position.copy()
        self.velocity = np.zeros_like(position)
        self.momentum = np.zeros_like(position)
        self.zmp = position.copy()

    def step(
        self,
        acceleration: Float64[np.ndarray, " n"],
        momentum_rate: Float64[np.ndarray, " n"],
        dt: float,
    ) -> None:
        """Moves on under inputs that stay the same for a while; exact.

        Args:
            acceleration: u_1 [m/s^2].
            momentum_rate: u_2 [N m].
            dt: how long [s].
        """
        self.zmp = self.position - acceleration / self.omega**2 - momentum_rate / self.weight
        self.position = self.position + dt * self.velocity + (0.5 * dt * dt) * acceleration
        self.velocity = self.velocity + dt * acceleration
        self.momentum = self.momentum + dt * momentum_rate


class ZmpRegulator:
    """Sugihara's regulator on the linear inverted pendulum, eqs (33) and (34).

        u = max(r_1, min(r_2, p_ref + k_s (p - p_ref) + b_s pdot)),   b_s = k_s / omega,  k_s > 1

    It commands the ZMP within a support from r_1 to r_2, where the COM shifter commands the COM's
    acceleration; the plant is pdd = omega^2 (p - u), eq. (32).

    Args:
        omega: sqrt(g / H) [1/s].
        ks: k_s.

    Raises:
        ConfigurationError: omega not positive, or k_s not above one.
    """

    def __init__(self, omega: float, *, ks: float = 2.0) -> None:
        self.omega = checked_number(omega, "omega of the regulator [1/s]", above=0.0)
        if not ks > 1.0:
            raise ConfigurationError("k_s of the regulator is too small", got=ks, wanted="> 1")
        self.ks, self.bs = float(ks), float(ks) / self.omega

    def zmp(
        self,
        reference: Float64[np.ndarray, " n"],
        position: Float64[np.ndarray, " n"],
        velocity: Float64[np.ndarray, " n"],
        support: tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " n"]],
    ) -> Float64[np.ndarray, " n"]:
        """Where the ZMP should be [m].

        Args:
            reference: of the COM [m].
            position: of the COM [m].
            velocity: of the COM [m/s].
            support: r_1 and r_2 [m].
        """
        wanted = reference + self.ks * (position - reference) + self.bs * velocity
        return np.clip(wanted, *support)


def pole_zero_damping(kp: float, omega: float) -> float:
    """k_d = k_p / omega + omega, eqs (30) and (38): cancels the slower pole against a zero.

    The ZMP then converges as fast as it can without overshoot.

    Args:
        kp: k_p [1/s^2].
        omega: [1/s].

    Raises:
        ConfigurationError: k_p <= omega^2, with which the pole that is cancelled is not the slower.
    """
    if not kp > omega * omega:
        raise ConfigurationError(
            "k_p of the COM shifter is too small for its table",
            got=kp,
            wanted=f"more than omega^2 = {omega * omega:.4g} /s^2",
        )
    return kp / omega + omega


class ComShifter:
    """A feedback from ZMP reference to COM acceleration, eqs (25a) and (37) of Zhang and Kikuuwe.

        a = sat(a_lim, k_p (r_ref - p) - k_d pdot)     each axis by itself

    No preview, no buffer: the reference may jump. While a is not saturated the COM follows by
    (27), and the ZMP of the cart-table model by (28), which under the gain rule (30) is first order
    after the first swing to the other side.

    Args:
        height: of the COM [m].
        kp: k_p [1/s^2].
        kd: k_d [1/s]; by the gain rule (30) when None.
        acceleration_max: a_lim [m/s^2].
        gravity: [m/s^2].

    Raises:
        ConfigurationError: k_p <= omega^2, or a number that is not positive.

    Attributes:
        omega: sqrt(g / H) [1/s].
    """

    def __init__(
        self,
        height: float,
        *,
        kp: float = 40.0,
        kd: float | None = None,
        acceleration_max: float = 0.8,
        gravity: float = GRAVITY,
    ) -> None:
        self.omega = natural_frequency(height, gravity)
        self.kp = checked_number(kp, "k_p of the COM shifter [1/s^2]", above=0.0)
        rule = pole_zero_damping(self.kp, self.omega)
        self.kd = rule if kd is None else checked_number(kd, "k_d of the COM shifter [1/s]")
        self.acceleration_max = checked_number(
            acceleration_max, "acceleration_max of the COM shifter [m/s^2]", above=0.0
        )

    def acceleration(
        self,
        reference: Float64[np.ndarray, " n"],
        position: Float64[np.ndarray, " n"],
        velocity: Float64[np.ndarray, " n"],
    ) -> Float64[np.ndarray, " n"]:
        """The COM's acceleration.

        Args:
            reference: of the ZMP [m].
            position: of the COM [m].
            velocity: of the COM [m/s].
        """
        wanted = self.unlimited(reference, position, velocity)
        return np.clip(wanted, -self.acceleration_max, self.acceleration_max)

    def unlimited(
        self,
        reference: Float64[np.ndarray, " n"],
        position: Float64[np.ndarray, " n"],
        velocity: Float64[np.ndarray, " n"],
    ) -> Float64[np.ndarray, " n"]:
        """The COM's acceleration before saturation.

        Under the gain rule its CT-ZMP is r_ref + k_s (xi - r_ref) with the divergent component
        xi = p + pdot / omega and k_s = 1 + k_p / omega^2: the regulator (33) without its limits.

        Args:
            reference: of the ZMP [m].
            position: of the COM [m].
            velocity: of the COM [m/s].
        """
        return self.kp * (reference - position) - self.kd * velocity

    def cart_table_zmp(
        self, position: Float64[np.ndarray, " n"], acceleration: Float64[np.ndarray, " n"]
    ) -> Float64[np.ndarray, " n"]:
        """CT-ZMP, eq. (26): where the ZMP were without angular momentum, p - a / omega^2 [m].

        Args:
            position: of the COM [m].
            acceleration: of the COM [m/s^2].
        """
        return position - acceleration / self.omega**2


class BodyRotator:
    """The rate of angular momentum that puts the ZMP on its reference, eqs (25b) and (39a).

        Ldot_x =  m g (r_ref,y - rhat_y)
        Ldot_y = -m g (r_ref,x - rhat_x)     with rhat the CT-ZMP

    It cannot act for ever: the body would turn. What uses it decides when.

    Args:
        weight: m g [N].

    Raises:
        ConfigurationError: not positive.
    """

    def __init__(self, weight: float) -> None:
        self.weight = checked_number(weight, "weight of the body rotator [N]", above=0.0)

    def momentum_rate(
        self, reference: Float64[np.ndarray, "2"], cart_table_zmp: Float64[np.ndarray, "2"]
    ) -> Float64[np.ndarray, "2"]:
        """Rate of the angular momentum about the COM, x and y [N m].

        Args:
            reference: of the ZMP, x and y [m].
            cart_table_zmp: the CT-ZMP, x and y [m].
        """
        x, y = (reference - cart_table_zmp).tolist()
        return self.weight * np.array([y, -x])
