"""The noise families of scenario files: their names, the keys they take, and the laws they build."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from locbounds import noise


class Family(NamedTuple):
    """A family.

    Attributes
    ----------
    law
        Class of :mod:`locbounds.noise`.
    needed, optional
        Keys of a noise table, each with the argument of the law that it gives.
    """

    law: Callable[..., noise.Noise]
    needed: dict[str, str]
    optional: Mapping[str, str] = MappingProxyType({})

    @property
    def keys(self) -> dict[str, str]:
        """All keys with their arguments."""
        return {**self.needed, **self.optional}


FAMILIES: dict[str, Family] = {
    "gaussian": Family(noise.Gaussian, {"std_m": "std"}, {"mean_m": "mean"}),
    "truncated-gaussian": Family(
        noise.TruncatedGaussian, {"std_m": "std"}, {"center_m": "center", "low_m": "low", "high_m": "high"}
    ),
    "uniform": Family(noise.Uniform, {"low_m": "low", "high_m": "high"}),
    "exponential": Family(noise.Exponential, {"scale_m": "scale"}, {"start_m": "start"}),
    "exponentially-modified-gaussian": Family(
        noise.ExponentiallyModifiedGaussian, {"std_m": "std", "scale_m": "scale"}, {"center_m": "center"}
    ),
    "student-t": Family(noise.StudentT, {"degrees": "degrees", "scale_m": "scale"}, {"center_m": "center"}),
    "laplace": Family(noise.Laplace, {"scale_m": "scale"}, {"center_m": "center"}),
    "gamma": Family(noise.Gamma, {"shape": "shape", "scale_m": "scale"}, {"start_m": "start"}),
    "log-normal": Family(noise.LogNormal, {"median_m": "median", "log_std": "log_std"}, {"start_m": "start"}),
}
MADE_OF = ("sum", "mixture")
PLAIN = ("weights", "means_m", "stds_m")
EVERY_KEY = tuple(dict.fromkeys(key for family in FAMILIES.values() for key in family.keys))


def build(family: str, values: dict[str, Any]) -> noise.Noise:
    """The law of a family from the keys of its table.

    >>> float(build("exponential", {"scale_m": 5.0}).mean)
    5.0
    """
    entry = FAMILIES[family]
    given = {argument: values[key] for key, argument in entry.keys.items() if values.get(key) is not None}
    defaults = {"mean": 0.0, "center": 0.0}
    for argument in entry.keys.values():
        if argument in defaults:
            given.setdefault(argument, defaults[argument])
    return entry.law(**given)


def family_of(law: noise.Noise) -> str | None:
    """The name of a law's family, or None if it is made of others.

    >>> family_of(noise.Laplace(0.0, 1.0))
    'laplace'
    """
    return next((name for name, family in FAMILIES.items() if type(law) is family.law), None)
