"""HTTP's digest authentication (RFC 7616): a device sends a challenge with a 401, and each request after it answers."""

import hashlib
import threading
from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

from requests.auth import HTTPDigestAuth
from requests.utils import parse_dict_header

from conformance.commandline.secrecy import SECRETS

_SCHEME = "digest "


class DigestUser(HTTPDigestAuth):
    """A user with a password, and the challenge that the device sent last; several threads may use it.

    Args:
        pair: ``user:password``.
    """

    def __init__(self, pair: str) -> None:
        self._pair = pair
        user, _, password = pair.partition(":")
        super().__init__(user, password)
        # requests keeps a challenge per thread, but a device that counts its uses expects one count for all threads.
        self._thread_local: Any = SimpleNamespace()
        self._lock = threading.Lock()
        self.init_per_thread_state()

    def learn(self, headers: Iterable[tuple[str, str]]) -> bool:
        """Take the challenge of a 401 response; return whether it can be answered."""
        offers = [value for name, value in headers if name.lower() == "www-authenticate"]
        for offer in offers:
            at = offer.lower().find(_SCHEME)
            if at < 0:
                continue
            with self._lock:
                before = self._thread_local.chal
                self._thread_local.chal = parse_dict_header(offer[at + len(_SCHEME) :])
                # The realm's hash takes the place of the user name (RFC 7616 3.4.2).
                user, _, password = self._pair.partition(":")
                whole = f"{user}:{self._thread_local.chal.get('realm', '')}:{password}".encode()
                for algorithm in ("md5", "sha256"):
                    SECRETS.keep(hashlib.new(algorithm, whole, usedforsecurity=False).hexdigest(), "$ROAAS_DIGEST")
                try:
                    if self.build_digest_header("GET", "http://device/"):
                        return True
                except KeyError:  # no realm, or no nonce
                    pass
                self._thread_local.chal = before
        return False

    def answer(self, method: str, target: str) -> str:
        """Return the value of Authorization for a request; empty while the device has sent no challenge."""
        with self._lock:
            if not self._thread_local.chal:
                return ""
            return self.build_digest_header(method, f"http://device{target}") or ""
