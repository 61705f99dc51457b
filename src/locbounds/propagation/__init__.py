"""Radio paths between buildings: what blocks the sight, and the shortest way around the corners."""

from locbounds.propagation.city import Building, City
from locbounds.propagation.links import Links, street_links
from locbounds.propagation.street_ranges import StreetRanges

__all__ = ["Building", "City", "Links", "StreetRanges", "street_links"]
