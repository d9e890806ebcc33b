"""No error names an option that the command which prints it does not have.

A text that several commands may print goes through `advice`, which knows the running command. Here each other text is
compared with the options of every command whose modules it is in, also by imports of imports.
"""

import ast
import re
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import click
import click.testing
import grimp
import pytest

import roaas
from conformance.commandline.device_options import advice

ROOMS = ("conformance", "loadtests", "reference_robot", "reports", "ros_probe", "proof")
ROOT = Path(__file__).parents[1]
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+")
# A text may send its reader to another command.
ELSEWHERE = re.compile(r"`roaas [^`]*`")
# What these print is an error, however it is put together. Options in a shell's command are curl's.
SHARED = re.compile(r"conformance\.(transport(?!.shell)|documents|statement|contract|engine\.(describ|connect)ing)\b")
# `roaas diff` reaches this through the front door.
FURTHER = {"diff": "conformance.engine.comparing"}


def commands(command: click.Command, name: str) -> Iterator[tuple[str, click.Command]]:
    if isinstance(command, click.Group):
        for word, one in command.commands.items():
            yield from commands(one, f"{name} {word}")
    else:
        yield name, command


def options_in(path: Path, *, everywhere: bool) -> set[str]:
    """Options that the error texts of a module name: those of raise statements, or of all but docstrings."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = list(ast.walk(tree))
    advised = {"advice", "option", "add_argument", "addoption"}
    passed = {
        id(part)
        for node in nodes
        if (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))
        or (isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")) in advised)
        for part in ast.walk(node)
    }  # fmt: skip
    errors = nodes if everywhere else [part for node in nodes if isinstance(node, ast.Raise) for part in ast.walk(node)]
    texts = (node.value for node in errors if isinstance(node, ast.Constant) and id(node) not in passed)
    return {option for text in texts if isinstance(text, str) for option in OPTION.findall(ELSEWHERE.sub("", text))}


def test_no_error_names_an_option_that_its_command_lacks():
    graph = grimp.build_graph(*ROOMS, cache_dir=None)
    named: dict[str, set[str]] = {}
    for module in graph.modules:
        path = ROOT / f"{module.replace('.', '/')}.py"
        if path.exists():
            named[module] = options_in(path, everywhere=bool(SHARED.match(module)))
    tops = {word: roaas.main.get_command(None, word) for word in roaas.main.list_commands(None)}
    own = {word: (next(iter(dict(commands(top, word)).values()))).callback.__module__ for word, top in tops.items()}
    wrong, seen = [], 0
    for word, module in own.items():
        start = {module, FURTHER.get(word, module)}
        reached = start | {one for each in start for one in graph.find_upstream_modules(each)}
        for name, command in commands(tops[word], word):
            known = {option for one in command.params for option in one.opts} | {"--help"}
            for one in (reached - set(own.values())) & named.keys():
                seen += bool(named[one])
                wrong += [f"{name}: {one} names {option}" for option in named[one] - known]
    assert not wrong, "\n".join(wrong)
    assert seen > 10, "the texts are found at all"


@click.command()
@click.option("--token-file")
def with_token(token_file):  # noqa: ARG001 - it has the option
    click.echo(advice("--token-file or --basic-file", "--token-file", "none"))


@click.command()
def with_none():
    click.echo(advice("--token-file or --basic-file", "--token-file", "none") + advice("--token-file"))


@pytest.mark.parametrize(("command", "text"), [(with_token, "--token-file\n"), (with_none, "none\n")])
def test_advice_names_what_the_command_has(command, text):
    assert click.testing.CliRunner().invoke(command).output == text


def test_advice_without_a_command_is_the_whole():
    assert advice("--token-file or --basic-file", "none") == "--token-file or --basic-file"


class Guarded(BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_error(401)

    def log_message(self, *_: object) -> None:
        pass


def test_diff_of_a_guarded_description_names_no_option():
    with ThreadingHTTPServer(("127.0.0.1", 0), Guarded) as server:
        Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        url = f"http://127.0.0.1:{server.server_port}/openapi.json"
        done = click.testing.CliRunner().invoke(roaas.main, ["diff", url, url])
        server.shutdown()
    assert done.exit_code == 2
    assert "are credentials missing? Save it to a file, and name that" in done.stderr
    assert "--" not in done.stderr.partition("Error:")[2]
