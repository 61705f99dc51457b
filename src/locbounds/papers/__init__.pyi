# What type checkers see, and what is imported on first use: nobody waits for the papers that are not asked for.
from . import chen2010, fritsche2013, mcguire2009, prieto2011

__all__ = ["chen2010", "fritsche2013", "mcguire2009", "prieto2011"]
