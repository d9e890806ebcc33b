"""Compare two descriptions of an API, from URLs, files or results."""

from pathlib import Path

from conformance.commandline.given_files import read_json, read_octets
from conformance.documents.description import Description, DescriptionError, read_description
from conformance.documents.json_schema import UnresolvedError
from conformance.documents.operation_compatibility import Change, changes
from conformance.target.describing import FOLDER, fetch_description
from conformance.transport.client import Connection


def compare(old: str, new: str, *, allow_files: bool = False) -> list[Change]:
    """Return the changes between the descriptions at two URLs or in two files.

    With ``allow_files``, they may refer to files outside their folders.

    Raises:
        DescriptionError: one of them cannot be used.
        UnreachableError: a server does not respond.
    """
    connection = Connection()
    descriptions = [
        _of_result(text) if _is_of_result(text) else fetch_description(text, (), connection, allow_files=allow_files)
        for text in (old, new)
    ]
    # The target of an unread reference may have changed, even if the reference did not.
    unread = [
        Change(None, source, f"not compared: {reference}")
        for source, description in zip((old, new), descriptions, strict=True)
        for reference in (*description.unresolved, *description.unread)
    ]
    try:
        return [*changes(*(one.document for one in descriptions)), *unread]
    except RecursionError as error:
        raise DescriptionError(f"{old} and {new} cannot be compared, one is nested too deeply") from error
    except (UnresolvedError, AttributeError, TypeError, KeyError) as error:
        raise DescriptionError(f"{old} and {new} cannot be compared, one is malformed: {error!r}") from error


def _is_of_result(source: str) -> bool:
    """Return whether a file is the description that a run wrote into its result: nothing that it refers to is read."""
    folder = Path(source).parent
    return folder.name == FOLDER and (folder.parent / "result.json").exists()


def _of_result(source: str) -> Description:
    """Return the complete description in a result.

    Raises:
        DescriptionError: it cannot be used.
    """

    def load(place: str) -> bytes:
        if place != source:
            raise OSError("the description of a result leads nowhere else")
        octets = read_octets(Path(source))
        read_json(octets)  # runs write JSON, and reading it as YAML takes much longer
        return octets

    return read_description(source, load)
