"""Help, schema and manual: complete, and no example in them is wrong."""

import html
import re
import shlex
import tomllib
from html.parser import HTMLParser

import msgspec
import pytest
import typer

from planner.campaign.config import CampaignConfig
from planner.campaign.store import EXAMPLE
from planner.cli.app import app
from planner.design.propose import ACQUISITIONS, DESCRIPTIONS, DESIGNS
from planner.milling.cut import Cut, load_cut
from planner.milling.tool import ToolTable, load_tool
from planner.robot.config import RobotConfig
from tests.support.outside import call, said, told

COMMANDS = typer.main.get_command(app).commands


def parsed(line: str) -> None:
    """Raise where a command line names an unknown command or option, or lacks an argument."""
    name, *rest = shlex.split(line.split("#", maxsplit=1)[0])
    assert name == "planner"
    command = COMMANDS[rest[0]]
    command.make_context(rest[0], rest[1:])  # raises on bad usage


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_command_has_an_example_that_it_takes(name):
    text = COMMANDS[name].help or ""
    example = " ".join(text.partition("Example:")[2].split())
    assert example.startswith(f"planner {name} "), text
    parsed(example)


def names_of(kind: type[msgspec.Struct]) -> set[str]:
    return {field.encode_name for field in msgspec.structs.fields(kind)}


KINDS = {"robot": RobotConfig, "campaign": CampaignConfig, "cut": Cut, "tool": ToolTable}


@pytest.mark.parametrize(("file", "kind"), KINDS.items())
def test_the_schema_names_every_entry(file, kind):
    answer = told("schema", file)
    tables = {t["name"].strip("[]"): t for t in answer["tables"]}
    entries = {e["name"] for e in tables[""]["entries"]} | {n.split(".")[0] for n in tables if n}
    assert entries == names_of(kind)
    assert all(t["about"] for t in answer["tables"])
    definitions = answer["json_schema"]["$defs"]
    assert set(definitions[kind.__name__]["properties"]) == names_of(kind)
    screen = said("schema", file)
    assert all(f"[{name}]" in screen for name in tables if name)


def test_the_schema_tells_defaults_and_choices():
    tables = {t["name"]: t["entries"] for t in told("schema", "campaign")["tables"]}
    modes = {e["name"]: e for e in tables["[modes]"]}
    assert (modes["count"]["default"], modes["band_hz"]["takes"]) == ("4", "[number, number]")
    assert modes["count"]["takes"] == "whole number"
    assert tables["[fidelity]"][0]["takes"] == '"frozen" or "none" or "updated"'
    assert call("schema", "log")[0] == 2


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The manual, as its command writes it."""
    path = tmp_path_factory.mktemp("manual") / "manual.html"
    said("manual", "--out", path)
    return path.read_text()


def test_the_tutorials_commands_are_taken(written):
    section = re.search(r'<section id="tutorial">(.*?)</section>', written, re.DOTALL)
    assert section
    blocks = re.findall(r"<pre>(.*?)</pre>", section[1], re.DOTALL)
    lines = [line for block in blocks for line in html.unescape(block).splitlines()]
    assert len(lines) > 8
    for line in lines:
        parsed(line)


def test_the_manual_quotes_files_that_are_right(written):
    found: list[str] = []
    reader = HTMLParser()
    reader.handle_data = found.append
    reader.feed(written)
    text = "".join(found)
    robot = (EXAMPLE / "robot" / "robot.toml").read_text()
    assert robot in text
    assert tomllib.loads(robot)["urdf"] == "robot.urdf"
    assert all(f"planner {name}" in text for name in COMMANDS)
    assert all(name in text for name in names_of(RobotConfig) | names_of(CampaignConfig))
    assert not re.search(r"https?://|<script", written)
    links = re.findall(r'href="#(\w+)"', written)
    assert links
    assert all(f'id="{link}"' in written for link in links)


def test_every_acquisition_is_told_in_schema_and_manual(written):
    assert set(DESCRIPTIONS) == {*ACQUISITIONS, *DESIGNS}
    schema = said("schema", "campaign")
    for name, about in DESCRIPTIONS.items():
        assert f"{name}: {about.split()[0]}" in schema
        assert about in html.unescape(written)


def test_help_swallows_no_brackets():
    assert "[controller]" in said("export", "--help")


def test_the_shell_completes(monkeypatch, capsys):
    monkeypatch.setenv("_PLANNER_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "planner re")
    monkeypatch.setenv("COMP_CWORD", "1")
    with pytest.raises(SystemExit):
        typer.main.get_command(app)(prog_name="planner", args=[])
    assert {"replay", "report"} <= set(capsys.readouterr().out.split())


def test_the_examples_of_cut_and_tool_are_taken():
    assert load_cut(EXAMPLE / "cut.toml").teeth == 2
    assert load_tool(EXAMPLE / "tool.toml").parts[0].contact is not None
