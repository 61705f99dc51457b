"""Every bad scenario file gives one clear error: key path, value, remedy, nearest known key."""

import pytest

from locbounds.errors import InputError
from locbounds.io.scenario_file import load, loads

GOOD = """
format = 1
[time]
step_s = 0.2
steps = 10
[motion]
model = "constant-velocity"
psd_m2_s3 = 0.5
[prior]
position_m = [500, 500]
position_std_m = 50
velocity_m_s = [5, 5]
velocity_std_m_s = 2
[links]
measure = "range"
sight = { stay = 0.9, start = { los = 0.5, nlos = 0.5 } }
los = { std_m = 150 }
nlos = { plus_los = true, mean_m = 513, std_m = 409 }
[anchors]
bs1 = { position_m = [-3000, -2000] }
bs2 = { position_m = [3000, 5000] }
"""
SIGHT = "stay = 0.9, start = { los = 0.5, nlos = 0.5 }"

BAD = [
    # (what is replaced, by what, words of the cause, words of the remedy)
    ("std_m = 150", "std = 150", "unknown key links.los.std = 150", "Did you mean std_m?"),
    ("std_m = 150", "std_km = 0.15", "unknown key links.los.std_km = 0.15", "Did you mean std_m?"),
    ("std_m = 150", "std_m = -3", "links.los.std_m is -3, but must be positive", "metres"),
    ("std_m = 150", "std_m = 0", "links.los.std_m is 0, but must be positive", "metres"),
    ("std_m = 150", 'std_m = "150"', "links.los.std_m is '150', not a number", "without quotes"),
    ("std_m = 150", "std_m = true", "links.los.std_m is True, not a number", ""),
    ("std_m = 150", "std_m = nan", "links.los.std_m is nan", "finite"),
    ("std_m = 150", "std_m = inf", "links.los.std_m is inf", "finite"),
    ("std_m = 150", "mean_m = 3", "links.los has no std_m", "Add std_m"),
    ("std_m = 150", "std_m = 150, plus_los = true", "unknown key links.los.plus_los", "Known here: mean_m, std_m"),
    ("std_m = 150", "weights = [0.5, 0.6], means_m = [0, 0], stds_m = [1, 2]", "sum to 1.1", "sum to one"),
    ("std_m = 150", "weights = [1], means_m = [0, 0], stds_m = [1, 2]", "different lengths", "per component"),
    ("std_m = 150", "weights = [1], means_m = [0]", "links.los has weights, means_m", "stds_m"),
    ("los = { std_m = 150 }", "los = 150", "links.los is 150, not a table", "{ std_m = 150 }"),
    ("los = { std_m = 150 }", "", "anchors.bs1 has no los", "Add los to [links]"),
    ("std_m = 409", "std_m = -409", "links.nlos.std_m is -409", "metres"),
    ("plus_los = true", "plus_los = 1", "links.nlos.plus_los is 1", "true"),
    ("step_s = 0.2", "step_ms = 200", "unknown key time.step_ms = 200", "Did you mean step_s?"),
    ("step_s = 0.2", "step_s = 0", "time.step_s is 0, but must be positive", "step_s = 0.2"),
    ("steps = 10", "steps = 0", "time.steps is 0, but must be at least 1", "prior"),
    ("steps = 10", "steps = 1.5", "time.steps is 1.5, not a whole number", ""),
    ("steps = 10", "", "time has step_s", "Give step_s and steps"),
    ("step_s = 0.2\nsteps = 10", "times_s = [0]", "0 steps", "at least one"),
    ("step_s = 0.2\nsteps = 10", "times_s = [0, 1, 1, 2]", "time of step 2 is 1.0 s after 1.0 s", "merge duplicates"),
    ("step_s = 0.2\nsteps = 10", "times_s = [0, 2, 1]", "time of step 2 is 1.0 s after 2.0 s", "sort them"),
    ("step_s = 0.2\nsteps = 10", "times_s = [0, 1, 3]", "intervals vary from 1 to 2 s", "dwell_s"),
    ("step_s = 0.2\nsteps = 10", "times_s = [0, nan]", "time.times_s is nan", "finite"),
    ("[time]", "[times]", "unknown key times", "Did you mean time?"),
    ("[time]\nstep_s = 0.2\nsteps = 10\n", "", "time is missing", "Add time: a section [time]"),
    ("model =", "modell =", "unknown key motion.modell", "Did you mean model?"),
    ('"constant-velocity"', '"constant-speed"', "motion.model is 'constant-speed'", "constant-velocity-discrete"),
    ("psd_m2_s3", "psd", "unknown key motion.psd", "Did you mean psd_m2_s3?"),
    ("psd_m2_s3 = 0.5", "psd_m2_s3 = -1", "motion.psd_m2_s3 is -1", "a number or one per axis"),
    ("psd_m2_s3 = 0.5", "psd_m2_s3 = [1, 2, 3]", "motion.psd_m2_s3 has 3 numbers", "one per coordinate"),
    ("psd_m2_s3", "acceleration_var_m2_s4", "motion has model", "takes psd_m2_s3"),
    ("position_std_m = 50", "position_std_m = [[1, 2], [2, 1]]", "not positive semidefinite", "symmetric"),
    ("position_std_m = 50", "position_std_m = [[4, 1], [0, 4]]", "not positive semidefinite", "symmetric"),
    ("position_std_m = 50", "position_std_m = [[4, 1], [0]]", "not a square matrix", "row by row"),
    ("position_std_m = 50", "position_std_m = 0", "prior.position_std_m is 0, but must be positive", "zeros"),
    ("position_std_m = 50", "position_std_m = [1, 2, 3]", "prior has 2 coordinates, but position_std_m has 3", ""),
    ("position_std_m = 50", "", "prior has no position_std_m", "Add position_std_m"),
    ("position_std_m = 50", "covariance = [[1]]", "prior has both", "Keep one"),
    (
        "position_std_m = 50\nvelocity_m_s = [5, 5]\nvelocity_std_m_s = 2",
        "velocity_m_s = [5, 5]\ncovariance = [[1]]",
        "covariance of 1 rows",
        "Give 4",
    ),
    ("velocity_m_s = [5, 5]", "velocity_m_s = 5", "prior.velocity_m_s is 5, not a list", "square brackets"),
    (
        "velocity_m_s = [5, 5]",
        "velocity_km_h = [18, 18]",
        "unknown key prior.velocity_km_h",
        "Did you mean velocity_m_s?",
    ),
    ("velocity_m_s = [5, 5]", "velocity_m_s = [5, 5, 5]", "2 position and 3 velocity coordinates", ""),
    (SIGHT, "stay = 1.2", "links.sight.stay is 1.2, but must lie between 0 and 1", ""),
    (SIGHT, "stay = 0.9, start = { los = 0.5, nlos = 0.6 }", "which sums to 1.1", "sum to one"),
    (SIGHT, "stay = 0.9, start = { los = 1.5, nlos = -0.5 }", "is 1.5, but must lie between", ""),
    (SIGHT, "stay = 0.9, start = 0.5", "links.sight.start is 0.5", "los = .., nlos = .."),
    (SIGHT, "transition = [[0.9, 0.2], [0.1, 0.9]]", "has row 1 = [0.9, 0.2], which sums to 1.1", "summing to one"),
    (SIGHT, "transition = [[0.9, 0.1], [-0.1, 1.1]]", "has row 2", "not negative"),
    (SIGHT, "transition = [[1]]", "has 1 rows", "2 x 2"),
    (SIGHT, "stay = 0.9, dwell_s = { los = 1, nlos = 1 }", "has stay, dwell_s", "Give one of"),
    (SIGHT, "start = { los = 0.5, nlos = 0.5 }", "has no chain", "Give one of"),
    (SIGHT, "dwell_s = { los = 2, nlos = 0 }", "links.sight.dwell_s is 0, but must be positive", ""),
    (SIGHT, 'known = "LLN"', "3 letters for 10 steps", "one per step"),
    (SIGHT, 'known = "LLNX"', "the schedule is 'LLNX'", "L and N"),
    (SIGHT, 'known = [{ until_s = 1, sight = "los" }]', "the schedule ends at 1 s", "without until_s"),
    (SIGHT, 'known = [{ until_ms = 1, sight = "los" }]', "unknown key until_ms", "Did you mean until_s?"),
    (SIGHT, 'known = [{ until_s = 1, sight = "line" }]', "is not valid", "growing times"),
    (SIGHT, "known = 3", "the schedule is 3", "one letter per step"),
    (SIGHT, 'known = "LLLLLLLLLL", start = { los = 1, nlos = 0 }', "has known and start", "remove it"),
    ('"range"', '"tdoa"', "links.measure is 'tdoa'", "range"),
    ("[anchors]", "outlier = { share = 1.0, std_m = 3 }\n[anchors]", "has share = 1", "below 1"),
    ("[anchors]", "outlier = { share = 0.1 }\n[anchors]", "links.outlier.std_m is missing", "Add std_m"),
    ("[anchors]", "missing_steps = [11]\n[anchors]", "step 11 is after the last step 10", "from 1"),
    (
        "[anchors]",
        "missing_steps = [0]\n[anchors]",
        "links.missing_steps.0 is 0, but must be at least 1",
        "missing_steps",
    ),
    ("[anchors]", 'anchors_csv = "nowhere.csv"\n[anchors]', "cannot read the anchors from nowhere.csv", "CSV"),
    ("position_m = [-3000, -2000]", "lat = 48.1, lon = 11.5", "unknown key anchors.bs1.lat", "metres in a local plane"),
    ("position_m = [-3000, -2000]", "position_deg = [48.1, 11.5]", "unknown key anchors.bs1.position_deg", "metres"),
    ("position_m = [-3000, -2000]", "positon_m = [0, 0]", "anchors.bs1.positon_m", "Did you mean position_m?"),
    (
        "position_m = [-3000, -2000]",
        "position_m = [1, 2, 3]",
        "anchors.bs1.position_m has 3 coordinates",
        "same number",
    ),
    ("position_m = [-3000, -2000]", "position_m = [1]", "anchors.bs1.position_m has 1 coordinates", "2 or 3"),
    ("position_m = [-3000, -2000]", "position_m = [1, nan]", "anchors.bs1.position_m is nan", "finite"),
    ("position_m = [-3000, -2000]", "los = { std_m = 1 }", "anchor bs1 has no position", "position_m"),
    ("bs1 = { position_m = [-3000, -2000] }\nbs2 = { position_m = [3000, 5000] }", "", "there are no anchors", "NAME"),
    ("velocity_std_m_s = 2", "velocity_std_m_s = 2\nsteps = 3", "unknown key prior.steps", "It belongs in [time]"),
    ("format = 1", "format = 2", "format is 2", "format = 1"),
    ("format = 1", "", "format is missing", "format = 1"),
    ("format = 1", "format = 1\ntitle = 3", "title is 3, not text", "quotes"),
    ("[prior]", "[prior", "is not valid TOML", "line"),
    ("steps = 10", "steps = 10\nsteps = 11", "is not valid TOML", "line"),
]


@pytest.mark.parametrize(
    ("old", "new", "cause", "remedy"), BAD, ids=[bad[1][:40] or "no " + bad[0][:30] for bad in BAD]
)
def test_bad_file(old, new, cause, remedy):
    assert old in GOOD
    with pytest.raises(InputError) as caught:
        loads(GOOD.replace(old, new, 1), source="s.toml")
    assert caught.value.cause.startswith("s.toml")
    assert cause in caught.value.cause
    assert caught.value.remedy
    assert remedy in caught.value.remedy


def test_the_good_one_is_good():
    assert len(loads(GOOD).links) == 2


def test_unreadable_files(tmp_path):
    with pytest.raises(InputError, match=r"no such file.*locbounds new"):
        load(tmp_path / "none.toml")
    with pytest.raises(InputError, match="cannot read"):
        load(tmp_path)
    (tmp_path / "b.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8"):
        load(tmp_path / "b.toml")


@pytest.mark.parametrize(
    ("table", "cause"),
    [
        ("", "has no column anchor_id"),
        ("anchor_id,x_m\n", "has no column y_m"),
        ("anchor_id,x,y\na,1,2\n", "has no column x_m"),
        ("anchor_id,lat,lon\na,48,11\n", "latitude"),
        ("anchor_id,x_m,y_m\n", "has no anchors"),
        ("anchor_id,x_m,y_m\na,1,two\n", "line 2, y_m is 'two'"),
        ("anchor_id,x_m,y_m\na,1,nan\n", "line 2, y_m is 'nan'"),
        ("anchor_id,x_m,y_m\na,1\n", "line 2, y_m is ''"),
        ("anchor_id,x_m,y_m\na,1,2\na,3,4\n", "line 3: the name 'a' is given twice"),
        ("anchor_id,x_m,y_m\n,1,2\n", "line 2: the name '' is empty"),
        ("anchor_id,x_m,y_m,z_m\na,1,2,3\n", "anchors.a.position_m has 3 coordinates"),
    ],
)
def test_bad_anchor_tables(tmp_path, table, cause):
    (tmp_path / "anchors.csv").write_text(table)
    text = 'anchors_csv = "anchors.csv"\n' + GOOD.split("[anchors]")[0]
    with pytest.raises(InputError, match=cause.replace("(", r"\(")):
        loads(text, folder=tmp_path)


def test_an_anchor_missing_from_the_anchor_table(tmp_path):
    (tmp_path / "anchors.csv").write_text("anchor_id,x_m,y_m\nbs2,1,2\n")
    text = GOOD.replace("position_m = [-3000, -2000]", "los = { std_m = 1 }")
    with pytest.raises(InputError, match=r"anchor bs1 has no position and is not in anchors\.csv"):
        loads('anchors_csv = "anchors.csv"\n' + text, folder=tmp_path)
