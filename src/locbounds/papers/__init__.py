"""The papers: one file each, with their scenarios, published numbers, tables and figures."""

from locbounds.papers import chen2010, fritsche2013, mcguire2009, prieto2011

__all__ = ["chen2010", "fritsche2013", "mcguire2009", "prieto2011"]
