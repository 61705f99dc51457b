"""Radio paths between buildings: what blocks the sight, and the shortest way around the corners."""

from locbounds.propagation.city import Building, City
from locbounds.propagation.links import Links, street_links

__all__ = ["Building", "City", "Links", "street_links"]
