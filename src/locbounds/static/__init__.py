"""Bounds and estimators of a static position: what a plan permits."""

from locbounds.static.barankin import barankin
from locbounds.static.estimators import ls, ml
from locbounds.static.mmse import mmse
from locbounds.static.noise_levels import bounds_over_noise
from locbounds.static.tightest import Tightest, tightest
from locbounds.static.weiss_weinstein import wwb
from locbounds.static.ziv_zakai import ezzb

__all__ = ["Tightest", "barankin", "bounds_over_noise", "ezzb", "ls", "ml", "mmse", "tightest", "wwb"]
