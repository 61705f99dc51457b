"""The papers: one file each, with their scenarios, published numbers, tables and figures."""

from locbounds.papers import fritsche2013, mcguire2009

__all__ = ["fritsche2013", "mcguire2009"]
