"""The click options on a device with a description that several commands share, and advice that names options."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from conformance.commandline.help_pages import Group, options_of

_Command = TypeVar("_Command", bound=Callable[..., Any])
_FILE = click.Path(exists=True, dir_okay=False)
_OPTION = re.compile(r"--[a-z][a-z-]+")

_DESCRIPTION = (
    options_of(Group.DEVICE, rare=True),
    click.option("--openapi", metavar="URL|FILE", help="OpenAPI or Swagger description to judge the device by."),
    click.option("--wsdl", metavar="URL|FILE", help="WSDL to judge the device by."),
    click.option(
        "--schemas",
        type=click.Path(exists=True, file_okay=False, path_type=Path),
        metavar="FOLDER",
        help="Folder with the schemas that the WSDL imports, if their addresses do not work.",
    ),
    click.option("--overlay", "overlays", multiple=True, metavar="FILE", help="OpenAPI Overlay to apply; repeatable."),
    click.option("--base-url", metavar="URL", help="Address of the description's operations."),
    click.option("--allow-files", is_flag=True, help="A description in a file may refer to files outside its folder."),
    options_of(Group.CALLS),
    click.option(
        "--call",
        "allow",
        multiple=True,
        metavar="PATTERN",
        help="Also call operations that may change something: 'POST /api/move/*', an operationId or a tag; repeatable.",
    ),
    click.option("--never", multiple=True, metavar="PATTERN", help="Never call these operations; repeatable."),
)
_CREDENTIALS = (
    options_of(Group.CREDENTIALS),
    click.option("--basic-file", type=_FILE, help="File with user:password for basic authentication."),
    click.option("--api-key-file", type=_FILE, help="File with the API key."),
    click.option("--api-key", metavar="'PLACE NAME'", help="Place and name of the API key: header, query or cookie."),
    options_of(Group.CREDENTIALS, rare=True),
    click.option("--digest-file", type=_FILE, help="File with user:password for digest authentication (RFC 7616)."),
    click.option(
        "--username-token-file", type=_FILE, help="File with user:password for WS-Security's UsernameToken (SOAP)."
    ),
    click.option(
        "--trust-host",
        "trust_hosts",
        multiple=True,
        metavar="HOST[:PORT]",
        help="Also follow addresses on this server, and send it the credentials; repeatable.",
    ),
    click.option("--headers-file", type=_FILE, help="File with headers to send, 'Name: value' in each line."),
)
_CLIENT_CERTIFICATE = (
    options_of(Group.CREDENTIALS, rare=True),
    click.option("--client-cert-file", type=_FILE, help="Client certificate (PEM) for HTTPS."),
    click.option("--client-key-file", type=_FILE, help="Its key, if it is not in the same file."),
    click.option("--client-key-passphrase-file", type=_FILE, help="File with the passphrase of that key."),
)


def advice(*texts: str) -> str:
    """Return the first text whose options the running command has; empty if there is none.

    Several commands read the same files and reach the same servers, with different options. Where no command runs, the
    first text is returned.
    """
    running = click.get_current_context(silent=True)
    known = {option for parameter in running.command.params for option in parameter.opts} if running else None
    return next((text for text in texts if known is None or known.issuperset(_OPTION.findall(text))), "")


def description_options(command: _Command) -> _Command:
    """Add the options for a device's description and for the operations that may be called."""
    return _with(command, _DESCRIPTION)


def credential_options(command: _Command) -> _Command:
    """Add the options on credentials other than the bearer token."""
    return _with(command, (*_CREDENTIALS, *_CLIENT_CERTIFICATE))


def client_certificate_options(command: _Command) -> _Command:
    """Add the options on a client certificate."""
    return _with(command, _CLIENT_CERTIFICATE)


def _with(command: _Command, options: tuple[Callable[[_Command], _Command], ...]) -> _Command:
    for option in reversed(options):
        command = option(command)
    return command
