"""``calib-inspect info``: parameters and multiply-adds of a network."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from inspector.cli.output import JSON_FILE, console_beside, overwrite_option, prepare_json, write_json

if TYPE_CHECKING:
    from rich.table import Table


@click.command()
@click.option(
    "--preset", default="compact", show_default=True, help="Network to describe: compact, paper or another preset."
)
@click.option("--json", "json_file", type=JSON_FILE, metavar="FILE|-", help="Also as JSON; - for stdout.")
@overwrite_option
def info(preset: str, json_file: str | None) -> None:
    """Print the parameters and multiply-adds of a network, by module and in total.

    Multiply-adds are those of one forward pass, one stage, at 256 x 512 pixels.
    """
    from calibnet.evaluation.counting import HEIGHT, WIDTH, count
    from calibnet.geometry import RANGES
    from calibnet.network.config import load_preset
    from calibnet.network.network import CalibrationNetwork

    prepare_json(json_file)
    network = CalibrationNetwork(load_preset(preset), RANGES[0])  # any range: the cost is the same
    costs = count(network)
    modules = [
        {"name": cost.name, "parameters": cost.parameters, "multiply_adds": cost.multiply_adds} for cost in costs
    ]
    content: dict[str, Any] = {
        "preset": preset,
        "input": [HEIGHT, WIDTH],
        "parameters": sum(cost.parameters for cost in costs),
        "multiply_adds": sum(cost.multiply_adds for cost in costs),
        "modules": modules,
    }
    console_beside(json_file).print(cost_table(content))
    write_json(json_file, content)


def cost_table(content: dict[str, Any]) -> Table:
    """A table with one row per module and one for the total."""
    from rich.table import Table

    table = Table(title=f"{content['preset']}, one stage at {content['input'][0]} x {content['input'][1]}")
    table.add_column("module")
    table.add_column("parameters", justify="right")
    table.add_column("multiply-adds", justify="right")
    for module in content["modules"]:
        table.add_row(module["name"], *amounts(module))
    table.add_section()
    table.add_row("total", *amounts(content))
    return table


def amounts(entry: dict[str, Any]) -> tuple[str, str]:
    """Parameters in millions and multiply-adds in billions."""
    return f"{entry['parameters'] / 1e6:.3f} M", f"{entry['multiply_adds'] / 1e9:.3f} G"
