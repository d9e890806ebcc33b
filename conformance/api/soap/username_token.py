"""The header block with WS-Security's UsernameToken (OASIS UsernameToken Profile 1.0, 3.1)."""

from typing import Final

from conformance.documents.xml_names import clark
from conformance.documents.xml_node import Node
from conformance.transport.username_token import UsernameToken

_WSS: Final = "http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-"
_SECURITY: Final = f"{_WSS}wssecurity-secext-1.0.xsd"
_UTILITY: Final = f"{_WSS}wssecurity-utility-1.0.xsd"
_DIGEST: Final = f"{_WSS}username-token-profile-1.0#PasswordDigest"
_BASE64: Final = f"{_WSS}soap-message-security-1.0#Base64Binary"


def block_of(user: UsernameToken, envelope: str) -> Node:
    """Return a header block with a fresh nonce, for an Envelope of that namespace."""
    digest, nonce, created = user.fresh()
    token = Node(
        clark(_SECURITY, "UsernameToken"),
        children=(
            Node(clark(_SECURITY, "Username"), user.user),
            Node(clark(_SECURITY, "Password"), digest, (), (("Type", _DIGEST),)),
            Node(clark(_SECURITY, "Nonce"), nonce, (), (("EncodingType", _BASE64),)),
            Node(clark(_UTILITY, "Created"), created),
        ),
    )
    return Node(clark(_SECURITY, "Security"), "", (token,), ((clark(envelope, "mustUnderstand"), "1"),))
