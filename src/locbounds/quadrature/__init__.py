"""Means of random draws, with their standard errors."""

from locbounds.quadrature.replicates import deviations, standard_error

__all__ = ["deviations", "standard_error"]
