"""The command line explains itself."""

import importlib
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from netsp.command.main import COMMANDS, _parser, main

ALL = {name: command for group in COMMANDS.values() for name, command in group.items()}


def test_help_names_every_command_by_what_it_is_for(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    text = capsys.readouterr().out
    for purpose, group in COMMANDS.items():
        assert f"\n  {purpose}\n" in text
        assert all(f"    {name} " in text for name in group)


@pytest.mark.parametrize("name", ALL)
def test_the_example_of_every_command_is_one(name, capsys):
    command = ALL[name]
    words = shlex.split(command.example.split(" > ")[0])
    assert words[:2] == ["netsp", name]
    assert _parser({name}).parse_args(words[1:]).declared is command
    assert callable(importlib.import_module(command.module).run)
    with pytest.raises(SystemExit):
        main([name, "--help"])
    assert command.example in capsys.readouterr().out


@pytest.mark.parametrize("name", ALL)
def test_help_loads_nothing_heavy(name):
    code = (
        "import sys\nfrom netsp.command.main import main\n"
        f"try:\n    main([{name!r}, '--help'])\nexcept SystemExit:\n    pass\n"
        "print(*sorted({'numpy', 'numba', 'pydantic', 'matplotlib'} & sys.modules.keys()), "
        "file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stderr.strip() == ""


@pytest.mark.skipif(sys.platform != "linux", reason="needs /dev/full")
def test_help_to_a_full_disk_fails_in_one_line():
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "netsp", "--help"], stdout=full, stderr=subprocess.PIPE
        )
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "offered"),
    [(("netsp", "so"), "solve"), (("netsp", "solve", "--ti"), "--time-limit"),
     (("netsp", "solve", "--solver", "reduced"), "reduced-mip"),
     (("netsp", "export", "--format", "geo"), "geojson"),
     (("netsp", "simulate", "--planner", "pred"), "predictive"),
     (("netsp", "schema", "sce"), "scene-surprises"), (("netsp", "plot", "prob"), "problems")],
)  # fmt: skip
def test_bash_completes_commands_options_choices_and_files(words, offered, tmp_path, capsys):
    assert main(["completion", "bash"]) == 0
    script = tmp_path / "netsp.bash"
    script.write_text(capsys.readouterr().out)
    asked = f"""
        source {script}
        COMP_WORDS=({" ".join(words)}) COMP_CWORD={len(words) - 1}
        _shtab_netsp netsp {words[-1]} {words[-2]}
        printf '%s\\n' "${{COMPREPLY[@]}}"
    """
    root = Path(__file__).parent.parent
    done = subprocess.run(["bash", "-c", asked], capture_output=True, text=True, cwd=root)
    assert offered in done.stdout.split(), done.stderr
