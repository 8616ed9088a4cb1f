"""Sessions of the page: the token, sent once, becomes a cookie that no script reads and no other site can use.

The cookie holds no secret of its own. It is its time of expiry, and the HMAC of this time with the token as its key. So
sessions survive a restart of the service, and a new token ends all of them.
"""

from __future__ import annotations

import hashlib
import hmac
import re
import time
from urllib.parse import urlsplit

SECONDS = 12 * 3600
"""Duration of a session, s."""
SAFE_METHODS = ("GET", "HEAD")
OWN_SITES = ("same-origin", "none")
"""Sec-Fetch-Site values of requests of the page itself, and of an address that a person typed."""


class Sessions:
    """Makes and checks the cookies of one service.

    >>> sessions = Sessions("token")
    >>> sessions.is_known(sessions.made()), sessions.is_known("99999999999.forged")
    (True, False)
    """

    def __init__(self, token: str) -> None:
        self._key = token.encode()
        # browsers send cookies to all ports of a machine: each service has its own name for the cookie
        self.cookie = f"vibroimpact-{self._signed('name')[:12]}"
        self._value = re.compile(rf"(?:^|[; ]){self.cookie}=([0-9]{{1,12}}\.[0-9a-f]{{64}})(?=;|$)")

    def made(self) -> str:
        """Return the value of a new session."""
        end = str(int(time.time()) + SECONDS)
        return f"{end}.{self._signed(end)}"

    def is_known(self, value: str) -> bool:
        """Whether a value is a session that has not expired."""
        end, _, signature = value.partition(".")
        signed = hmac.compare_digest(signature.encode(), self._signed(end).encode())
        return signed and float(end) > time.time()

    def are_in(self, headers: dict[bytes, bytes], method: str) -> bool:
        """Whether a request carries a session, and comes from the page of this service itself."""
        # the sender is not known yet: only one cookie is searched for, the others are not parsed
        found = self._value.search(headers.get(b"cookie", b"").decode("latin-1"))
        if found is None or not self.is_known(found[1]):
            return False
        if headers.get(b"sec-fetch-site", b"none").decode("latin-1") not in OWN_SITES:
            return False
        return method in SAFE_METHODS or is_own_origin(headers)

    def _signed(self, text: str) -> str:
        return hmac.new(self._key, f"session {text}".encode(), hashlib.sha256).hexdigest()


def is_own_origin(headers: dict[bytes, bytes]) -> bool:
    """Whether the browser states that a request comes from a page of its target host.

    >>> is_own_origin({b"host": b"127.0.0.1:8737", b"origin": b"http://127.0.0.1:8737"})
    True
    >>> is_own_origin({b"host": b"127.0.0.1:8737", b"origin": b"http://127.0.0.1:9999"})
    False
    """
    origin, host = headers.get(b"origin", b"").decode("latin-1"), headers.get(b"host", b"").decode("latin-1")
    try:
        return bool(host) and urlsplit(origin).netloc == host
    except ValueError:
        return False
