"""Results for people: figures, tables, files, and scenarios in words."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["plot"])
