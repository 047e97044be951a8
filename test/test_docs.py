"""What the documentation and the help tell people to type and to look for."""

import argparse
import re
import shlex
from pathlib import Path

import pytest

from gesture_bot.cli.main import command_line
from gesture_bot.nodes.start import parse_arguments

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
ROOMS = (
    "base", "cli", "nodes", "speech", "corpus", "matching", "refine", "retarget", "servo", "evaluate",
    "recording", "studio",
)  # fmt: skip
PARSER = command_line()


def accepts(line):
    """Whether the argument parser takes a `gesture-bot` line of a shell."""
    words = shlex.split(re.sub(r'^eval "\$\((.*)\)"$', r"\1", line), comments=True)
    words = words[words.index("gesture-bot") + 1 :]
    ends = [words.index(end) for end in ("&", "&&", "|", ">", ";") if end in words]
    try:
        options = PARSER.parse_args(words[: min(ends, default=len(words))])
        if getattr(options, "module", "") == "run":
            parse_arguments(options.arguments)
    except SystemExit as ended:
        return ended.code == 0
    return True


def commands_of(text):
    """The `gesture-bot` lines of the shell blocks of a page."""
    for block in re.findall(r"```sh\n(.*?)```", text, re.DOTALL):
        for line in block.replace("\\\n", " ").splitlines():
            if re.search(r"(^|[ (])gesture-bot( |$)", line.partition("#")[0]):
                yield line


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_of_a_page_is_one(page):
    refused = [line for line in commands_of(page.read_text()) if not accepts(line)]
    assert not refused


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_somewhere(page):
    links = [link.partition("#")[0] for link in re.findall(r"\]\(([^)]+)\)", page.read_text())]
    missing = [link for link in links if "://" not in link and not (page.parent / link).exists()]
    assert not missing


def parsers(parser):
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                yield from parsers(inner)


def test_every_help_ends_with_examples_that_work():
    for parser in parsers(PARSER):
        lines = parser.format_help().rpartition("examples:\n")[2].splitlines()
        assert lines, parser.prog
        for line in lines:
            assert parser.prog in line
            assert accepts(line.strip()), line


def test_troubleshooting_has_the_texts_of_the_code():
    code = "\n".join(path.read_text() for room in ROOMS for path in (ROOT / room).glob("*.py"))
    code = re.sub(r'"\s*\n\s*f?"', "", code)  # a text over several lines
    for heading in re.findall(
        r"^### `(.*)`$", (ROOT / "docs" / "troubleshooting.md").read_text(), re.MULTILINE
    ):
        for part in heading.split("..."):
            assert part.strip() in code, heading
