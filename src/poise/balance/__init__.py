"""Balance on the cart-flywheel-table: where the COM goes so that the ZMP goes elsewhere."""

from poise.balance.body_rotator import BodyRotator
from poise.balance.cart_table import CartFlywheelTable, natural_frequency
from poise.balance.com_shifter import ComShifter, pole_zero_damping
from poise.balance.preview import PreviewControl
from poise.balance.regulator import ZmpRegulator
from poise.balance.saturation import saturate

__all__ = [
    "BodyRotator",
    "CartFlywheelTable",
    "ComShifter",
    "PreviewControl",
    "ZmpRegulator",
    "natural_frequency",
    "pole_zero_damping",
    "saturate",
]
