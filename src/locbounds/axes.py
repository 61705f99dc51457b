"""The one vocabulary of array axes, used in every shape annotation and docstring.

=============  ==================================================================================
axis           meaning
=============  ==================================================================================
``steps``      measurement times 1..K
``times``      steps 0..K, the prior's included: ``steps+1`` rows
``state``      components of the mobile's state, positions first
``space``      2 or 3 position coordinates
``links``      anchors, in the scenario's order
``points``     positions at which something is evaluated
``channels``   measured numbers of a static plan
``nodes``      nodes of a quadrature
``modes``      sight conditions of one link: 0 = LOS, 1 = NLOS
``components`` components of a Gaussian mixture
``samples``    Monte Carlo draws
``runs``       simulated tracks
``groups``     groups of Monte Carlo blocks, the unit of every standard error
``window``     ages 0..W-1 of a state relative to the horizon (0 is the newest)
=============  ==================================================================================
"""

import jax
from jaxtyping import Bool, Float, Int
from numpy import ndarray

LOS, NLOS = 0, 1

Array = jax.Array | ndarray
"""NumPy outside, JAX inside a kernel."""

Scalar = Float[Array, ""] | float
"""One number: an array without axes, or a float."""

__all__ = ["LOS", "NLOS", "Array", "Bool", "Float", "Int", "Scalar", "ndarray"]
