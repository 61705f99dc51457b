"""Linear algebra on arrays only: symmetric positive semidefinite checks, roots and tiny inverses."""

from locbounds.linalg.small import small_inverse
from locbounds.linalg.symmetric import is_positive_semidefinite, psd_root, symmetrize

__all__ = ["is_positive_semidefinite", "psd_root", "small_inverse", "symmetrize"]
