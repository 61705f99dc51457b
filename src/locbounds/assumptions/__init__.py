"""Assumptions of bounds on scenarios and models, as predicates: what violates them, and why."""

from locbounds.assumptions.functions import (
    CONTINUOUS_FUNCTIONS,
    FINITE_GEOMETRY,
    discontinuous,
    infinite_information,
)
from locbounds.assumptions.structure import (
    GAUSSIAN_MOTION,
    LINEAR_CHANNELS,
    LINEAR_MOTION,
    MARKOV_CHAINS,
    OWN_DENSITIES,
    SMOOTH_CHANNELS,
)

COMMON = (GAUSSIAN_MOTION, MARKOV_CHAINS, CONTINUOUS_FUNCTIONS, FINITE_GEOMETRY)
MODEL = (*COMMON, SMOOTH_CHANNELS, OWN_DENSITIES)

__all__ = [
    "COMMON",
    "CONTINUOUS_FUNCTIONS",
    "FINITE_GEOMETRY",
    "GAUSSIAN_MOTION",
    "LINEAR_CHANNELS",
    "LINEAR_MOTION",
    "MARKOV_CHAINS",
    "MODEL",
    "OWN_DENSITIES",
    "SMOOTH_CHANNELS",
    "discontinuous",
    "infinite_information",
]
