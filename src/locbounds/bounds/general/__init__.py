"""The general engine: any jump-Markov model."""

from locbounds.bounds.general.engine import general

__all__ = ["general"]
