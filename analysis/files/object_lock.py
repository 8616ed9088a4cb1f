"""One campaign at a time at an address: a lock object with an owner, whose beat shows that the owner lives.

An object store releases no lock when its holder dies. The holder therefore writes the object anew every few seconds. A
lock without a new beat for the time of a lease has lost its holder, and is taken over. A holder that was only stopped
for so long finds another owner at its next beat, and gives up. Until then two holders may write side by side.
"""

from __future__ import annotations

import json
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from vibroimpact.analysis.files.object_paths import ObjectPath
from vibroimpact.fmus.errors import CampaignError, UsageError
from vibroimpact.fmus.messages import WITH_OUTPUT, message

BEAT_SECONDS = 5.0
"""Time between two beats of a holder, s."""
LEASE_SECONDS = 30.0
"""Time without a beat, s, after which a lock has lost its holder; several beats, as one write may take long."""
_MOST_TRIES = 5


@contextmanager
def locked_address(home: ObjectPath, note: Callable[[str], object]) -> Iterator[Callable[[], None]]:
    """Hold an address for this process; yield a function that raises CampaignError once another process holds it.

    Parameters
    ----------
    home : ObjectPath
    note : callable
        Receives a line while the holder of an old lock is waited for.

    Raises
    ------
    UsageError
        Another process holds it, or nothing can be written there.
    """
    holder = _Holder(home)
    holder.take(note)
    beating = threading.Thread(target=holder.beat_until_ended, daemon=True)
    beating.start()
    try:
        yield holder.refuse_lost
    finally:
        holder.ended.set()
        beating.join()
        holder.release()


class _Holder:
    """The holder of one lock object."""

    def __init__(self, home: ObjectPath) -> None:
        self._home, self._lock = home, home / ".lock"
        self._owner, self._beats = secrets.token_hex(16), 0
        self.ended = threading.Event()
        self._lost = threading.Event()

    def take(self, note: Callable[[str], object]) -> None:
        """Create the lock object, once its last holder has released it or lost it."""
        for _ in range(_MOST_TRIES):
            try:
                self._lock.create(self._content())
                return
            except FileExistsError:
                self._wait_for_holder(note)
            except OSError as error:
                raise UsageError(
                    message(
                        f"{self._home}: expected an address that can be written, got {error.strerror}. "
                        "Choose another",
                        WITH_OUTPUT,
                        ".",
                    )
                ) from error
        raise self._held_elsewhere()

    def _wait_for_holder(self, note: Callable[[str], object]) -> None:
        """Return when the lock has no holder any more; raise UsageError at a beat of its holder."""
        seen, began, is_noted = self._read(), time.monotonic(), False
        while seen is not None and (waited := time.monotonic() - began) < LEASE_SECONDS:
            if waited > 2 * BEAT_SECONDS and not is_noted:
                left, is_noted = LEASE_SECONDS - waited, True
                note(f"{self._lock}: the lock of a campaign without a beat. This one begins in {left:.0f} s.")
            time.sleep(BEAT_SECONDS / 4)
            found = self._read()
            if found is not None and found != seen:
                raise self._held_elsewhere()
            seen = found
        if seen is not None and self._read() == seen:
            self._lock.unlink(missing_ok=True)

    def _held_elsewhere(self) -> UsageError:
        return UsageError(
            f"{self._home}: expected an address of its own, got one in which another campaign is running. "
            "Wait for it, or choose another address."
        )

    def _content(self) -> bytes:
        self._beats += 1
        return json.dumps({"owner": self._owner, "host": socket.gethostname(), "beat": self._beats}).encode()

    def _read(self) -> bytes | None:
        try:
            return self._lock.read_bytes()
        except FileNotFoundError:
            return None

    def beat_until_ended(self) -> None:
        """Write the lock anew at each beat, until the campaign ends or another owner has taken the lock over."""
        while not self.ended.wait(BEAT_SECONDS):
            # an object store out of reach for some beats: the campaign's own writes say so
            with suppress(OSError):
                if self._is_of_another():
                    self._lost.set()
                    return
                self._lock.write_bytes(self._content())

    def _is_of_another(self) -> bool:
        found = self._read()
        return found is not None and self._owner.encode() not in found

    def refuse_lost(self) -> None:
        """Raise CampaignError if another process has taken the lock over."""
        if self._lost.is_set():
            raise CampaignError(
                f"{self._home}: another campaign has taken over, since this one gave no sign for "
                f"{LEASE_SECONDS:.0f} s. Wait for it; then the same command resumes."
            )

    def release(self) -> None:
        """Remove the lock, unless another process has taken it over or the store is out of reach."""
        with suppress(OSError):
            if not self._is_of_another():
                self._lock.unlink(missing_ok=True)
