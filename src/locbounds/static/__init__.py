"""Bounds and estimators of a static position: what a plan permits."""
