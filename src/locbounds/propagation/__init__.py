"""Radio paths between buildings: what blocks the sight, and the shortest way around the corners."""

from locbounds.propagation.cells import StreetCell, street_cells, uniform_on
from locbounds.propagation.city import Building, City
from locbounds.propagation.link_table import LinkTable
from locbounds.propagation.links import Links, street_links
from locbounds.propagation.street_ranges import StreetRanges

__all__ = [
    "Building",
    "City",
    "LinkTable",
    "Links",
    "StreetCell",
    "StreetRanges",
    "street_cells",
    "street_links",
    "uniform_on",
]
