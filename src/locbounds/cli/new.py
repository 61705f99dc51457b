"""``locbounds new``: a scenario file, or a plan file, to edit."""

from pathlib import Path
from typing import Annotated

import typer

from locbounds.cli.options import ForceOption

HEADER = """A scenario of locbounds: edit the numbers, then
    locbounds check {name}      what was understood, and a picture
    locbounds track {name}      bounds and filters over time
Lines that begin with # are comments; positions are metres in a local plane, not degrees."""
MOTION = """Other ways to move, each with the numbers of the prior that it needs:
    model = "random-walk", diffusion_m2_s = 1                           prior: position only
    model = "constant-acceleration", jerk_psd_m2_s5 = 0.1               prior: acceleration_m_s2, _std_m_s2 as well
    model = "coordinated-turn", psd_m2_s3 = 0.5, turn_rate_rad_s = 0.1  known turn rate"""
MODELS = ("constant-velocity", "random-walk", "constant-acceleration")
LINKS = """What all links share; an anchor may override any key, for example
    bs1 = {{ position_m = [-3000, -2000], los = {{ std_m = 100 }} }}
Other ways to say how the sight changes:
    sight = {{ stay = {{ los = 0.95, nlos = 0.8 }} }}                   start left out: the chain's long-run shares
    sight = {{ dwell_s = {{ los = 2, nlos = 2 }} }}                     mean seconds; right for uneven times
    sight = {{ known = [{{ until_s = 8, sight = "los" }}, {{ sight = "nlos" }}] }}
Rare wide errors in both conditions:
    outlier = {{ share = 0.01, std_m = 2000 }}"""


def new(
    path: Annotated[Path, typer.Argument(metavar="SCENARIO.toml", help="File to write.", show_default=False)],
    like: Annotated[
        str, typer.Option("--like", metavar="PAPER", help="Paper to start from; plan: a plan for locbounds map.")
    ] = "fritsche2013",
    motion: Annotated[
        str, typer.Option("--motion", metavar="MODEL", help="constant-velocity, random-walk or constant-acceleration.")
    ] = "constant-velocity",
    force: ForceOption = False,
) -> None:
    """Write a commented scenario file to edit, or with --like plan a plan file for locbounds map.

    Example: locbounds new scenario.toml --like fritsche2013
    """
    from locbounds.cli.paper_names import paper
    from locbounds.io.files import refuse_existing
    from locbounds.io.scenario_file import save

    refuse_existing(path, force=force)
    if like == "plan":
        from locbounds.io.files import atomic_write_text
        from locbounds.io.plan_example import PLAN

        atomic_write_text(path, PLAN.format(name=path))
        typer.echo(f"wrote {path}; next: locbounds map {path}")
        return
    comments = {"": HEADER.format(name=path), "motion": MOTION, "links": LINKS.format()}
    save(_moving(paper(like, also=("plan",)).scenario(), motion), path, comments)
    typer.echo(f"wrote {path}; next: locbounds check {path}")


def _moving(scenario, model: str):
    """The scenario with another motion of about the same restlessness over ten seconds."""
    import numpy as np

    from locbounds.errors import InputError
    from locbounds.motion import ConstantAcceleration, RandomWalk
    from locbounds.priors import GaussianPrior

    if model == "constant-velocity":
        return scenario
    if model not in MODELS:
        raise InputError(f"unknown motion {model!r}", f"Known: {', '.join(MODELS)}")
    prior, dim = scenario.prior, scenario.dim
    if model == "random-walk":
        motion, mean, covariance = RandomWalk(25.0, dim), prior.mean[:dim], prior.covariance[:dim, :dim]
    else:
        motion = ConstantAcceleration(0.05, dim)
        mean = np.concatenate([prior.mean, np.zeros(dim)])
        covariance = np.pad(prior.covariance, (0, dim)) + np.diag([0.0] * 2 * dim + [0.25] * dim)
    return scenario.replace(motion=motion, prior=GaussianPrior(mean, covariance))
