"""Sizes that requirements and checks share."""

from typing import Final

#: Octets of request content that every service accepts, over REST and over SOAP.
TAKEN_OCTETS: Final = 64 * 1024
#: Octets of request content over which no service need read on: it may close the connection.
LIMIT_OCTETS: Final = 10 * 1024 * 1024
