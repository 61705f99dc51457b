"""Weiss-Weinstein bounds of states that move, for any noise: they need no Fisher information."""

from locbounds.bounds.weinstein.gram import gram
from locbounds.bounds.weinstein.model import wwb_recursive
from locbounds.bounds.weinstein.path import path_bound, path_bounds
from locbounds.bounds.weinstein.recursion import weiss_weinstein_recursion

__all__ = ["gram", "path_bound", "path_bounds", "weiss_weinstein_recursion", "wwb_recursive"]
