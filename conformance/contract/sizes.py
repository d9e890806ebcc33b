"""Sizes that requirements and checks share."""

from typing import Final

#: Octets of request content that every service accepts, over REST and over SOAP.
TAKEN_OCTETS: Final = 64 * 1024
