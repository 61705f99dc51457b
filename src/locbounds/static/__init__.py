"""Bounds and estimators of a static position: what a plan permits."""

from locbounds.static import merit

__all__ = ["merit"]
