"""Compare two descriptions of an API, from URLs or files."""

from conformance.documents.compatibility import Change, changes
from conformance.documents.description import DescriptionError
from conformance.documents.json_schema import UnresolvedError
from conformance.engine.describing import fetch_description
from conformance.transport.client import Connection


def compared(old: str, new: str) -> list[Change]:
    """Return what changed between the descriptions at two URLs or in two files.

    Raises:
        DescriptionError: one of them cannot be used.
        UnreachableError: a server does not respond.
    """
    connection = Connection()
    descriptions = [fetch_description(source, (), connection) for source in (old, new)]
    # What a reference leads to may have changed, even if the reference did not.
    unread = [
        Change(None, source, f"not compared: {reference}")
        for source, description in zip((old, new), descriptions, strict=True)
        for reference in (*description.unresolved, *description.unread)
    ]
    try:
        return [*changes(*(one.document for one in descriptions)), *unread]
    except (UnresolvedError, AttributeError, TypeError, KeyError) as error:
        raise DescriptionError(f"{old} and {new} cannot be compared, one is malformed: {error!r}") from error
