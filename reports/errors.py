"""What can be wrong with a result file: one named exception for each kind.

Every message names the file, the place in it and the offending value, so that whoever produced the file can
act on it. The commands turn any of these into exit code 2.
"""


class ReportError(Exception):
    """Base of everything that keeps a report from being written or two results from being compared."""


class ResultMissingError(ReportError):
    """There is no result file where one was asked for."""


class ResultUnreadableError(ReportError):
    """The file is there, and the operating system or its encoding keeps us from reading it."""


class ResultGarbledError(ReportError):
    """The file is no JSON (RFC 8259), as after a run that was killed while it wrote."""


class ResultFormatError(ReportError):
    """The file is JSON and names another format, or another version of it, than the one that was expected."""


class ResultInvalidError(ReportError):
    """The file names the right format and breaks its JSON Schema."""


class ResultsIncompatibleError(ReportError):
    """Both files are valid, and hold nothing that could be compared."""


class KeyUnusableError(ReportError):
    """A key file that cannot be read, or holds another kind of key than the one that is needed."""


class PolicyUnusableError(ReportError):
    """A policy file that cannot be read, or asks for something that does not exist."""


class EnvelopeRefusedError(ReportError):
    """An envelope that proves nothing: it is garbled, of another kind, or not signed by the key that was given."""
