"""Define the exceptions for unusable input files of the reports, one exception class for each kind of problem.

Every message names the file, the place in it and the wrong value. A command that raises one of these prints the message
and ends with exit code 2.
"""

from click import ClickException

from reports.pages.untrusted import on_a_line

_MOST = 1000


class ReportError(ClickException):
    """The base class of these errors: no report can be written, or two results cannot be compared."""

    exit_code = 2

    def format_message(self) -> str:
        """Return the message for a terminal, on one line, as it may quote a file from anybody."""
        return on_a_line(self.message, _MOST)


class ResultMissingError(ReportError):
    """The error for a result file that does not exist."""


class ResultUnreadableError(ReportError):
    """The error for a file that cannot be read or written: the operating system refuses, or the text is not UTF-8."""


class ResultGarbledError(ReportError):
    """The error for a file that is not JSON (RFC 8259), for example because the run was killed while it wrote."""


class ResultFormatError(ReportError):
    """The error for a JSON file of another format or format version."""


class ResultInvalidError(ReportError):
    """The error for a file that violates the JSON Schema of its format, or that contradicts itself."""


class ResultUnsignableError(ResultInvalidError):
    """The error for a valid result that must not be signed: incomplete, edited, or beside files of another run."""


class ResultsIncompatibleError(ReportError):
    """The error for two valid results that cannot be compared."""


class KeyUnusableError(ReportError):
    """The error for a key file that cannot be read or written, or that holds another kind of key."""


class PolicyUnusableError(ReportError):
    """The error for a policy file that cannot be read, or that has an unknown field or a wrong value."""


class EnvelopeRefusedError(ReportError):
    """The error for an envelope that is malformed, of another kind, or not signed by the given key."""
