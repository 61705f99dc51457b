"""Accuracy bounds for locating a mobile over radio links that switch between line of sight and non-line of sight."""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
