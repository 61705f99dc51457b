"""The general engine: any jump-Markov model."""

from locbounds.bounds.general.engine import general
from locbounds.bounds.general.verdict import model_verdict

__all__ = ["general", "model_verdict"]
