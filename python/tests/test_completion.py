"""Shell completion, as the shells themselves do it."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from conftest import RunCli

from clothsim._cli import build_parser
from clothsim._cli.completion import SHELLS

# What is typed, and what has to be offered for its last word (a subset), and what must not.
CASES = [
    ("clothsim s", {"study", "stability", "schema"}, {"run", "plan"}),
    ("clothsim run --al", {"--allow-intersections"}, {"--out"}),
    ("clothsim run --device ", {"auto", "cpu", "gpu"}, {"a.toml"}),
    ("clothsim export -f ", {"usd", "gltf", "vtk"}, {"a.toml"}),
    ("clothsim run a", {"a.toml"}, {"b.txt"}),
    ("clothsim reproduce 4.1", {"4.10", "4.11"}, {"7.2"}),
    ("clothsim materials woo", {"wool", "wool-tropical"}, {"cotton"}),
    ("clothsim example dr", {"drape"}, {"flag"}),
    ("clothsim completion ", {"bash", "zsh", "fish"}, {"drape"}),
]

# Asks bash for the completions of a line as the keyboard would.
BASH = """
source "$1"; line=$2
read -ra COMP_WORDS <<< "$line"; [[ $line == *" " ]] && COMP_WORDS+=("")
COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); COMP_LINE=$line; COMP_POINT=${#line}
shell_function=$(complete -p clothsim | sed -n 's/.*-F \\([^ ]*\\).*/\\1/p')
"$shell_function" clothsim "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def scripts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    import sys

    folder = tmp_path_factory.mktemp("completion")
    for shell in SHELLS:
        command = [sys.executable, "-m", "clothsim", "completion", shell]
        (folder / shell).write_text(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    (folder / "here").mkdir()
    for name in ("a.toml", "b.txt"):
        (folder / "here" / name).touch()
    (folder / "here" / "results").mkdir()
    return folder


def offered(command: list[str], scripts: Path) -> set[str]:
    done = subprocess.run(command, cwd=scripts / "here", capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    return {line.split("\t")[0].strip().rstrip("/") for line in done.stdout.splitlines() if line.strip()}


@pytest.mark.parametrize(("line", "wanted", "unwanted"), CASES, ids=[case[0] for case in CASES])
def test_bash(scripts: Path, line: str, wanted: set[str], unwanted: set[str]) -> None:
    got = offered(["bash", "--norc", "-c", BASH, "bash", str(scripts / "bash"), line], scripts)
    assert wanted <= got, got
    assert not unwanted & got


def test_bash_offers_folders_alone_for_the_output(scripts: Path) -> None:
    line = "clothsim run a.toml -o "
    assert offered(["bash", "--norc", "-c", BASH, "bash", str(scripts / "bash"), line], scripts) == {"results"}


@pytest.mark.parametrize(("line", "wanted", "unwanted"), CASES, ids=[case[0] for case in CASES])
def test_fish(scripts: Path, line: str, wanted: set[str], unwanted: set[str]) -> None:
    if shutil.which("fish") is None:
        pytest.skip("fish is not installed")
    ask = f"source {scripts / 'fish'}; complete -C {line!r}"
    got = offered(["fish", "--no-config", "-c", ask], scripts)
    assert wanted <= got, got
    assert not unwanted & got


def test_zsh_reads_its_script(scripts: Path) -> None:
    """Zsh completes at a terminal alone; what it is given defines the function for the command and parses."""
    if shutil.which("zsh") is None:
        pytest.skip("zsh is not installed")
    script = f'autoload -Uz compinit && compinit -u -D && eval "$(<{scripts / "zsh"})" && print $_comps[clothsim]'
    done = subprocess.run(["zsh", "-f", "-c", script], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "_shtab_clothsim"
    assert done.stderr == ""


def test_every_shell_knows_every_command_and_option(scripts: Path) -> None:
    [commands] = [a.choices for a in build_parser()._actions if a.dest == "command" and a.choices is not None]
    for shell in SHELLS:
        text = (scripts / shell).read_text()
        for name, sub in dict(commands).items():
            assert name in text, (shell, name)
            for action in sub._actions:
                for option in action.option_strings:
                    assert option.lstrip("-") in text, (shell, name, option)


def test_an_unknown_shell_is_refused(run_cli: RunCli) -> None:
    done = run_cli("completion", "cmd")
    assert done.returncode == 2
    assert "bash" in done.stderr
