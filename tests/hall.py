"""A plan file of three ranges in a hall, and where its anchors are."""

import numpy as np

HALL = """
format = 1
title = "Hall"
[area]
low_m = [0, 0]
high_m = [40, 20]
[links]
measure = "toa"
los = { std_m = 2 }
[anchors]
a = { position_m = [0, 0] }
b = { position_m = [40, 0] }
c = { position_m = [20, 20] }
"""
PLACES = np.array([[0.0, 0.0], [40.0, 0.0], [20.0, 20.0]])
