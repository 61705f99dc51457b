"""A plan to start from, with comments that teach."""

PLAN = """# A plan of locbounds: edit the numbers, then
#     locbounds map {name}
# Lines that begin with # are comments; positions are metres in a local plane, not degrees.

format = 1                                    # units are in the keys; a wrong unit is an unknown key
title = "Hall with an annex, four anchors, differences of arrival times"
# clock = "unknown"                           # of "toa": a common clock offset; or clock_std_m = 30

# Where the map is drawn: an outline (with holes_m, if any), or a disc (center_m, radius_m), or a box (low_m, high_m).
# With anchors of three coordinates: height_m = 1.5, the height of the map, or [0, 3], what the device may have.
[area]
outline_m = [[0, 0], [60, 0], [60, 25], [35, 25], [35, 45], [0, 45]]

# What is known of the position before the measurement; left out: uniform over the area. The keys of [area], or a
# Gaussian (position_m, position_std_m), or mixture = [{{ share = 0.8, ... }}, {{ share = 0.2, ... }}].
# [prior]
# center_m = [20, 20]
# radius_m = 15

# What all links share; an anchor may override any key, for example
#     a4 = {{ position_m = [1, 44], sight = "nlos" }}                    known NLOS; without nlos it tells nothing
#     a5 = {{ position_m = [30, 30], measure = "aoa", los = {{ std_deg = 3 }} }}
[links]
measure = "tdoa"                              # "toa", "tdoa" (std_m of the arrival times), "rss" or "aoa"
los = {{ std_m = 0.5 }}                         # for rss: std_db, with exponent = 3; for aoa: std_rad or std_deg
# sight = {{ nlos = 0.3 }}                      # NLOS with this probability, which no one reports; then also
# nlos = {{ plus_los = true, family = "exponential", scale_m = 4 }}

[anchors]                                     # or, above [area]: anchors_csv = "anchors.csv"
a1 = {{ position_m = [1, 1] }}
a2 = {{ position_m = [59, 1] }}
a3 = {{ position_m = [59, 24] }}
a4 = {{ position_m = [1, 44] }}
"""
