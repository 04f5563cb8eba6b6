"""Options are declared as help shows them; files and policies are checked before work starts."""

import argparse

import pytest

from netsp.app.app_policy import AppPolicy
from netsp.base.errors import InputError
from netsp.command.command_options import Group, OneOf, Option, add_options, each_option
from netsp.command.command_policy import CommandPolicy
from netsp.command.command_table import COMMANDS
from netsp.command.main import main
from netsp.command.types import Number, length, natural
from netsp.mip.mip_policy import CoverPolicy
from netsp.study.compare.trial_policy import TrialPolicy
from netsp.study.library.rank import RankPolicy
from netsp.study.paths.free_route import FreeRoutePolicy
from netsp.view.pictures.picture_layout import (
    FilmLayout,
    LabelLayout,
    MapLayout,
    PageLayout,
    SpaceLayout,
)
from netsp.view.report.chart import ChartLayout
from netsp.view.report.stats import ReportPolicy

OPTIONS = (
    Option("FILE", "what is read"),
    Option("[MORE...]", dest="others"),
    Option("-o, --output FILE"),
    Option("--size L", "size of it", length, 2.0),
    Option("--seed N", "", natural, 0),
    Option("--pair N N", "two numbers", natural, (1, 2)),
    Option("--many N...", "numbers", natural),
    Option("--page [PORT]", "a page", natural, const=7),
    Option("--at-end {hold,leave}", default="hold"),
    Option("--crop, --no-crop", "crop it"),
    Option("--word TEXT", repeats=True),
    Group("more", (Option("--quiet", "say nothing"),)),
    OneOf((Option("--this"), Option("--that"))),
)


def parsed(*words):
    """Return the values of a command line with these options."""
    parser = argparse.ArgumentParser()
    add_options(parser, OPTIONS)
    return parser.parse_args(words)


def test_usage_says_how_an_option_is_read():
    args = parsed("a", "b", "c", "-o", "x", "--pair", "3", "4", "--many", "5", "6", "--page")
    assert (args.file, args.others, args.output) == ("a", ["b", "c"], "x")
    assert (args.pair, args.many, args.page) == ([3, 4], [5, 6], 7)
    assert (args.size, args.seed, args.at_end, args.quiet, args.crop) == (
        2.0,
        0,
        "hold",
        False,
        None,
    )
    args = parsed("a", "--no-crop", "--word", "x", "--word", "y", "--quiet", "--page", "9")
    assert (args.crop, args.word, args.quiet, args.page) == (False, ["x", "y"], True, 9)


@pytest.mark.parametrize("words", [(), ("a", "--at-end", "fly"), ("a", "--this", "--that")])
def test_usage_says_what_is_refused(words):
    with pytest.raises(SystemExit):
        parsed(*words)


def test_help_ends_with_defaults_that_are_numbers():
    parser = argparse.ArgumentParser()
    add_options(parser, OPTIONS)
    text = parser.format_help()
    assert "size of it; default 2" in text
    assert "--seed N" in text
    assert "default 0" in text
    assert "default hold" not in text


def test_numbers_are_read_within_their_range():
    share = Number("a share", 0.0, 1.0)
    assert [share(text) for text in ("0", "0.5", "1")] == [0.0, 0.5, 1.0]
    for text in ("-0.1", "1.1", "nan", "inf", "x", ""):
        with pytest.raises(argparse.ArgumentTypeError, match="expected a share"):
            share(text)


@pytest.mark.parametrize("name", [name for group in COMMANDS.values() for name in group])
def test_names_and_attributes_of_options_are_unique(name):
    (command,) = (group[name] for group in COMMANDS.values() if name in group)
    every = list(each_option(command.options))
    for values in ([each.name for each in every], [each.attribute for each in every]):
        assert len(set(values)) == len(values)


def test_files_are_checked_before_the_work_starts(tmp_path, capsys):
    file = tmp_path / "problem.json"
    file.write_text("{")
    assert main(["solve", str(file), "-o", str(file)]) == 2
    assert "would be overwritten, and it is an input" in capsys.readouterr().err
    assert main(["solve", str(file), "--plot", "x.txt"]) == 2
    assert "cannot draw this format" in capsys.readouterr().err
    assert main(["solve", str(file), "--json"]) == 2
    assert "--json: standard output is taken by the data" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("policy", "field", "value"),
    [
        (AppPolicy, "max_versions", -1),
        (CommandPolicy, "silence_s", 0.0),
        (CoverPolicy, "max_barriers", 63),
        (TrialPolicy, "hung_grace_s", float("nan")),
        (RankPolicy, "max_overtime_s", -1.0),
        (FreeRoutePolicy, "box_ratio", 2.5),
        (FilmLayout, "dpi", 0),
        (LabelLayout, "gap", -1.0),
        (MapLayout, "max_named", -1),
        (PageLayout, "frames", 0),
        (SpaceLayout, "tick_spacing", -0.1),
        (ChartLayout, "width", float("nan")),
        (ReportPolicy, "confidence", 1.5),
    ],
)
def test_numbers_of_policies_are_checked(policy, field, value):
    with pytest.raises(InputError, match=f"{field}: expected"):
        policy(**{field: value})
