"""How tests compile what runs once."""

QUICKLY = {"xla_backend_optimization_level": 0}
"""Options of ``jax.jit``: half the time to compile; the code is slower, its numbers agree to rounding."""
