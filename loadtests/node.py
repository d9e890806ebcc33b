"""A master or a worker of a load test, as the Locust operator for Kubernetes starts them.

The operator runs one image as `--master ARGS` once and as `--worker --master-host SERVICE ARGS` as often as wanted,
with the same ARGS. Here ARGS are those of `roaas load`; a worker ignores what only the master needs. When the master is
done it lingers, because its pod and the result in it vanish with it.
"""

import os
import sys
import time
from dataclasses import replace
from pathlib import Path

import click

from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.guard import make_streams_lenient
from conformance.transport.reach import Trust
from loadtests.cli import DEFAULT_OUT, load
from loadtests.clients.robot import as_http
from loadtests.described.device import CREDENTIALS, secrets_of
from loadtests.settings.settings import SettingsError

PORT = 5557
LINGER_S = 600.0


def main(words: list[str]) -> int:
    """Run as the master or as a worker; return the exit code of `roaas load`."""
    make_streams_lenient()
    if "--worker" in words:
        return _work(words)
    own = [word for word in words if word != "--master"]
    defaults = ["--master-host", "*", "--master-port", str(PORT), "--processes", "0"]
    try:
        code: int | None = load.main([*defaults, *own], prog_name="roaas load", standalone_mode=False)
    finally:
        linger = float(os.environ.get("ROAAS_LINGER_S", LINGER_S))
        sys.stderr.write(f"the result is kept for {linger:g} s: fetch it now\n")
        sys.stderr.flush()
        time.sleep(linger)
    return code or ExitCode.PASSED


def _work(words: list[str]) -> int:
    host = _value(words, "--master-host")
    if host is None:
        click.echo("--worker needs --master-host", err=True)
        return ExitCode.USAGE
    try:
        trust = Trust.of(*map(as_http, _values_of(words)), hosts=_values_of(words, "--trust-host"))
        secrets = secrets_of({name: _value(words, f"--{name.replace('_', '-')}") for name in CREDENTIALS})
    except (SettingsError, ValueError) as error:
        click.echo(f"roaas-load-node: {error}", err=True)
        return ExitCode.USAGE
    from loadtests.measuring.worker import serve  # noqa: PLC0415 -- imports Locust, which patches the process

    both = [replace(secrets, trust=trust)] * 2  # the same for both robots of --against
    port, folder = int(_value(words, "--master-port") or PORT), Path(_value(words, "--out") or DEFAULT_OUT)
    serve(host, port, both, folder, scenario=_value(words, "--scenario"))
    return ExitCode.PASSED


def _value(words: list[str], option: str) -> str | None:
    """Return an option's value."""
    return next(iter(_values_of(words, option)), None)


def _values_of(words: list[str], option: str = "") -> list[str]:
    """Return the values of an option, given as `--option value` or `--option=value`; without one, of all words."""
    apart = [part for word in words for part in (word.split("=", 1) if word.startswith("--") else [word])]
    pairs = zip(["", *apart], apart, strict=False)
    return [value for name, value in pairs if option in {"", name} and not value.startswith("--")]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
