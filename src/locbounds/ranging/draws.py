"""Drawing what sensors measure."""

from functools import partial

import jax
import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.noise import Epoch
from locbounds.precision import double_precision
from locbounds.ranging.sensors import Sensor, refuse_zero


@double_precision
def measure(
    sensors: tuple[Sensor, ...], d: Float[ndarray, "*n steps"], *, runs: int | None = None, seed: int = 0
) -> tuple[Float[ndarray, "runs steps samples"], ...]:
    """Samples of every sensor at steps 1..K.

    Parameters
    ----------
    sensors
        The sensors.
    d
        Distances at steps 1..K, [runs, steps], or [steps] with ``runs`` draws of the noise.
    runs, seed
        Number of draws for one track; seed.

    Raises
    ------
    RefusedError
        If a signal strength is asked for at a distance that is not positive.
    """
    d = np.asarray(d, dtype=float)
    if d.ndim == 1:
        d = np.broadcast_to(d, (1 if runs is None else runs, len(d)))
    refuse_zero(sensors, d.ravel())
    out = []
    for m, sensor in enumerate(sensors):
        key = jax.random.fold_in(jax.random.key(seed), m)
        error = np.asarray(_errors(sensor.noise, sensor.bias, sensor.samples, sensor.common, key, d.shape))
        out.append(np.asarray(sensor.mean(d))[..., None] + error)
    return tuple(out)


@partial(jax.jit, static_argnums=(2, 3, 5))
def _errors(noise, bias, samples, common, key, shape):
    if bias is None:
        return noise.sample(key, (*shape, samples))
    return Epoch(noise, bias, samples, common=common).sample(key, shape)
