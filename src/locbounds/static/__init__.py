"""Bounds and estimators of a static position: what a plan permits."""

from locbounds.static.barankin import barankin
from locbounds.static.mmse import mmse
from locbounds.static.weiss_weinstein import wwb
from locbounds.static.ziv_zakai import ezzb

__all__ = ["barankin", "ezzb", "mmse", "wwb"]
