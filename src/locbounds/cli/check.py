"""``locbounds check``: what was understood of a scenario file, what is dangerous in it, which bounds apply."""

from locbounds.cli.options import ForceOption, JsonOption, OutOption, ScenarioArgument, SeedOption


def check(
    scenario: ScenarioArgument,
    out: OutOption = None,
    seed: SeedOption = 0,
    json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Show what was understood, what is dangerous, which bounds apply; draw the picture scenario.png.

    Example: locbounds check scenario.toml
    """
    from locbounds.cli.options import default_out
    from locbounds.cli.output import output_folder, print_json, print_table
    from locbounds.io.scenario_file import load
    from locbounds.report.scenario_plot import draw_scenario
    from locbounds.report.understood import understood

    loaded = load(scenario)
    seen = understood(loaded)
    with output_folder(default_out(scenario, out), force=force) as folder:
        figure = draw_scenario(loaded, seed=seed)
        folder.write("scenario.png", lambda path: figure.savefig(path, dpi=150))
    if json:
        print_json({**seen, "picture": str(folder.path / "scenario.png")})
        return
    print_table(loaded.title or scenario.name, ("", ""), list(seen["model"].items()))
    links = seen["links"]
    print_table("Links", tuple(links[0]), [list(link.values()) for link in links])
    print_table(
        "Bounds", ("id", "applies", "why"), [[b["id"], b["status"], "; ".join(b["reasons"])] for b in seen["bounds"]]
    )
    print_table("Dangers", ("",), [[text] for text in seen["dangers"]] or [["none found"]])
    print_table("Files", ("",), [[folder.path / "scenario.png"]])
