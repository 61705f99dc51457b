"""Bounds on the error of a static position, and figures of merit."""
