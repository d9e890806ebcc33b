"""Exceptions for faults in a file from which a report is made, one for each kind of fault.

Every message names the file, the place in the file and the wrong value. A command that raises one of these prints the
message and ends with exit code 2.
"""

from click import ClickException


class ReportError(ClickException):
    """No report can be written, or two results cannot be compared."""

    exit_code = 2


class ResultMissingError(ReportError):
    """The result file does not exist."""


class ResultUnreadableError(ReportError):
    """The file cannot be read or written: the operating system refuses, or it is not UTF-8."""


class ResultGarbledError(ReportError):
    """The file is not JSON (RFC 8259), as after a run that was killed while it wrote."""


class ResultFormatError(ReportError):
    """The file is JSON of another format or format version."""


class ResultInvalidError(ReportError):
    """The file names the right format and violates its JSON Schema."""


class ResultsIncompatibleError(ReportError):
    """Two valid files have nothing in common that could be compared."""


class KeyUnusableError(ReportError):
    """A key file cannot be read, or holds another kind of key."""


class PolicyUnusableError(ReportError):
    """A policy file cannot be read, or has an unknown line or value."""


class EnvelopeRefusedError(ReportError):
    """An envelope is malformed, of another kind, or not signed by the given key."""
