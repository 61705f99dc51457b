"""The one vocabulary of array axes, used in every shape annotation and docstring.

=============  ==================================================================================
axis           meaning
=============  ==================================================================================
``steps``      measurement times 1..K; arrays that include the prior's time 0 have ``steps+1`` rows
``state``      components of the mobile's state, positions first
``space``      2 or 3 position coordinates
``links``      anchors, in the scenario's order
``modes``      sight conditions of one link: 0 = LOS, 1 = NLOS
``components`` components of a Gaussian mixture
``samples``    Monte Carlo draws
``runs``       simulated tracks
``groups``     groups of Monte Carlo blocks, the unit of every standard error
``window``     ages 0..W-1 of a state relative to the horizon (0 is the newest)
=============  ==================================================================================
"""

from jax import Array
from jaxtyping import Bool, Float, Int
from numpy import ndarray

LOS, NLOS = 0, 1
MODE_NAMES = ("los", "nlos")

type_array = Array | ndarray
__all__ = ["LOS", "MODE_NAMES", "NLOS", "Array", "Bool", "Float", "Int", "ndarray", "type_array"]
