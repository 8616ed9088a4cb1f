"""Limits of the operating system on a process that reads untrusted files: time, memory, writing, network.

On Linux, landlock (kernel 5.13) forbids to write, make, remove or rename files, and to start programs. Its version 4
adds TCP connections, version 6 adds signals to processes outside. This module makes the system calls itself, since
no package for landlock is maintained. On a kernel without landlock, `RLIMIT_FSIZE` still keeps files from growing.
"""

from __future__ import annotations

import ctypes
import math
import os
import signal
import sys
from pathlib import Path

#: Limit of the wall time, as a multiple of the limit of the processor time: other work may keep the machine busy.
PATIENCE = 6.0
UNKNOWN_MEMORY = 8 * 2**30
"""Memory to assume, byte, where the system does not report it."""
_CGROUP = Path("/sys/fs/cgroup/memory.max")
_MEMORY = Path("/proc/meminfo")
#: Numbers of the system calls, equal on all architectures with Python packages.
_CREATE_RULESET, _RESTRICT_SELF = 444, 446
_ASK_VERSION = 1
#: Options of Linux's prctl.
_PARENT_DEATH_SIGNAL = 1
_NO_NEW_PRIVILEGES = 38
#: Rights of version 1: all but reading files and folders (bits 2 and 3); then the rights that later versions added.
_EXECUTE, _CHANGE = 0b1, 0b1_1111_1111_0010
_LATER = {2: 1 << 13, 3: 1 << 14, 5: 1 << 15}
_BIND_AND_CONNECT = 0b11
_SOCKETS_AND_SIGNALS = 0b11


class _Ruleset(ctypes.Structure):
    """`struct landlock_ruleset_attr`: actions that are forbidden without a rule; this process sets no rule."""

    _fields_ = (("files", ctypes.c_uint64), ("network", ctypes.c_uint64), ("scopes", ctypes.c_uint64))


def confine(seconds: float, memory: int) -> None:
    """End this process after a processor time (s), and deny it more memory, writing and network.

    The limit of the wall time is `PATIENCE` times the processor time. `memory` (byte) is counted beyond the present
    use, and never exceeds the memory of the machine.
    """
    import resource

    _let_signals_end_it()
    signal.setitimer(signal.ITIMER_PROF, seconds)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE * seconds)
    lower_limit(resource.RLIMIT_CPU, math.ceil(seconds) + 1)  # holds when code stops the timers
    lower_limit(resource.RLIMIT_CORE, 0)
    lower_limit(resource.RLIMIT_FSIZE, 0)
    lower_limit(resource.RLIMIT_AS, _address_space() + min(memory, machine_memory()))
    forbid_writing_and_network()


def end_with_parent(parent: int) -> None:
    """Let the system end this process together with its parent; only Linux can."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PARENT_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != parent:
            os._exit(1)


def machine_memory() -> int:
    """Return the memory of this machine, or of this container, byte."""
    try:
        found = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        found = UNKNOWN_MEMORY
    try:
        limit = _CGROUP.read_text(encoding="ascii").strip()
    except OSError:
        return found
    return min(found, int(limit)) if limit.isdecimal() else found


def available_memory() -> int:
    """Return the memory that this machine can still give, byte; all of it where the system does not report more."""
    try:
        lines = _MEMORY.read_text(encoding="ascii").splitlines()
    except OSError:
        return machine_memory()
    found = [int(line.split()[1]) << 10 for line in lines if line.startswith("MemAvailable:")]
    return min([machine_memory(), *found])


def _let_signals_end_it() -> None:
    """Let signals of limits and stops end this process, whatever its parent set; ignored stops stay ignored."""
    limits = {signal.SIGALRM, signal.SIGPROF, signal.SIGXCPU}
    stops = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}
    ending = limits | {number for number in stops if signal.getsignal(number) != signal.SIG_IGN}
    signal.set_wakeup_fd(-1)
    for number in ending:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ending)


def _address_space() -> int:
    """Return the address space of this process, bytes; 0 where the system does not report it."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    except (OSError, ValueError):
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


def lower_limit(limit: int, value: int) -> None:
    """Lower a limit of this process for good; a limit that is already lower stays."""
    import resource

    now, _ = resource.getrlimit(limit)
    if now == resource.RLIM_INFINITY or value < now:
        try:
            resource.setrlimit(limit, (value, value))
        except (ValueError, OSError):
            return  # macOS declares some limits that it cannot set


def forbid_writing_and_network() -> int:
    """Forbid this process all that landlock can, for good; return its version, 0 on a kernel without landlock."""
    if sys.platform != "linux":
        return 0
    system = ctypes.CDLL(None, use_errno=True)
    version = int(system.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), ctypes.c_uint32(_ASK_VERSION)))
    if version < 1:
        return 0  # the kernel was built without landlock, or it is switched off
    later = sum(right for since, right in _LATER.items() if version >= since)
    rules = _Ruleset(
        _EXECUTE | _CHANGE | later,
        _BIND_AND_CONNECT if version >= 4 else 0,
        _SOCKETS_AND_SIGNALS if version >= 6 else 0,
    )
    size = ctypes.c_size_t(8 if version < 4 else 16 if version < 6 else 24)
    ruleset = int(system.syscall(_CREATE_RULESET, ctypes.byref(rules), size, ctypes.c_uint32(0)))
    if ruleset < 0:
        return 0
    system.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    failed = int(system.syscall(_RESTRICT_SELF, ruleset, ctypes.c_uint32(0)))
    os.close(ruleset)
    return 0 if failed else version
