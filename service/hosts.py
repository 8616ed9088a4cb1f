"""Host names of the service: a page under another name that leads here (DNS rebinding) gets no answer."""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Sequence

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import Argument, message

LOCAL = "localhost"
_NAME = re.compile(r"[a-z0-9]([a-z0-9\-_.]{0,252}[a-z0-9])?")
_PORT = re.compile(r":[0-9]{0,5}$")


class Hosts:
    """The hosts of one service: its listening address, `localhost`, and the given names.

    Raise UsageError for a text that is neither a name nor an address.

    >>> hosts = Hosts("127.0.0.1", ["lab.example"])
    >>> hosts.why_not(b"127.0.0.1:8737", "127.0.0.1"), hosts.why_not(b"LAB.example", "127.0.0.1")
    ('', '')
    >>> hosts.why_not(b"evil.example", "127.0.0.1")[:60]
    "Host: expected 127.0.0.1, lab.example or localhost, got 'evi"
    """

    def __init__(self, address: str, names: Sequence[str] = ()) -> None:
        given = [name.strip("[]").rstrip(".").lower() for name in names]
        for name, text in zip(given, names, strict=True):
            if not _NAME.fullmatch(name) and _address(name) is None:
                raise UsageError(
                    message(
                        Argument("allow_host"),
                        f": expected a name such as lab.example, without port, got {text!r}.",
                    )
                )
        self._names = sorted({*given, LOCAL, *([] if _is_any(address) else [address.lower()])})

    def why_not(self, host: bytes | None, served: str) -> str:
        """Return the reason to refuse a request for a host; empty if it is accepted.

        Browsers always send the header, and only browsers can be misled. `served` is the address of this machine at
        which the connection arrived.
        """
        if host is None:
            return ""
        name = _PORT.sub("", host.decode("latin-1")).strip("[]").rstrip(".").lower()
        address = _address(name)
        if name in self._names or (address and (address.is_loopback or address == _address(served))):
            return ""
        *others, last = self._names
        return (
            f"Host: expected {', '.join(others)} or {last}, got {name[:100]!r}. "
            "Start the service with --allow-host and this name to be asked by it."
        )


def _address(name: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        found = ipaddress.ip_address(name)
    except ValueError:
        return None
    return (found.ipv4_mapped or found) if isinstance(found, ipaddress.IPv6Address) else found


def _is_any(address: str) -> bool:
    """Return whether a service with this address listens on all addresses of the machine."""
    found = _address(address)
    return found is not None and found.is_unspecified
