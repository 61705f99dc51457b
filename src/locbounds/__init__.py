"""Bounds on how accurately a mobile device can be located over links that switch between LOS and NLOS."""

__version__ = "0.1.0"
