"""Limits that the system puts on a process that reads files of strangers: time, memory, no writing, no network.

On Linux the rules of landlock (kernel 5.13) forbid to open a file for writing, to make, remove or rename one, to start
a program; from its version 4 on also TCP connections, from 6 on signals to processes outside. No package of it is
maintained, so that its system calls are made here. A kernel without landlock keeps files from growing
(`RLIMIT_FSIZE`).
"""

from __future__ import annotations

import ctypes
import math
import os
import signal
import sys
from pathlib import Path

#: Wall time that a process gets, as a multiple of its processor time: the machine may be busy with other work.
PATIENCE = 6.0
UNKNOWN_MEMORY = 8 * 2**30
"""Memory that is assumed where the system does not say it, byte."""
_CGROUP = Path("/sys/fs/cgroup/memory.max")
#: Numbers of the system calls, equal on all architectures that Python packages are built for.
_CREATE_RULESET, _RESTRICT_SELF = 444, 446
_ASK_VERSION = 1
#: Options of Linux' prctl.
_PARENT_DEATH_SIGNAL = 1
_NO_NEW_PRIVILEGES = 38
#: Rights of version 1: all but reading files and folders (bits 2 and 3); then what later versions have added.
_EXECUTE, _CHANGE = 0b1, 0b1_1111_1111_0010
_LATER = {2: 1 << 13, 3: 1 << 14, 5: 1 << 15}
_BIND_AND_CONNECT = 0b11
_SOCKETS_AND_SIGNALS = 0b11


class _Ruleset(ctypes.Structure):
    """`struct landlock_ruleset_attr`: what is forbidden unless a rule allows it; here no rule does."""

    _fields_ = (("files", ctypes.c_uint64), ("network", ctypes.c_uint64), ("scopes", ctypes.c_uint64))


def confine(seconds: float, memory: int) -> None:
    """Let the system end this process after a processor time, and refuse it more memory, writing and network.

    Of wall time (s) it gets `PATIENCE` times as much. Memory is counted in bytes beyond what it has now, never more
    than the machine has.
    """
    import resource

    _let_signals_end_it()
    signal.setitimer(signal.ITIMER_PROF, seconds)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE * seconds)
    lower_limit(resource.RLIMIT_CPU, math.ceil(seconds) + 1)  # code that stops a timer does not stop this
    lower_limit(resource.RLIMIT_CORE, 0)
    lower_limit(resource.RLIMIT_FSIZE, 0)
    lower_limit(resource.RLIMIT_AS, _address_space() + min(memory, machine_memory()))
    forbid_writing_and_network()


def end_with_parent(parent: int) -> None:
    """Let the system end this process with the one that made it, where it can: on Linux."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PARENT_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != parent:
            os._exit(1)


def machine_memory() -> int:
    """Return the memory that this machine, or this container, has, byte."""
    try:
        found = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        found = UNKNOWN_MEMORY
    try:
        limit = _CGROUP.read_text(encoding="ascii").strip()
    except OSError:
        return found
    return min(found, int(limit)) if limit.isdecimal() else found


def _let_signals_end_it() -> None:
    """Let signals that limit or stop this process end it, whatever its maker does with them; ignored ones stay so."""
    limits = {signal.SIGALRM, signal.SIGPROF, signal.SIGXCPU}
    stops = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}
    ending = limits | {number for number in stops if signal.getsignal(number) != signal.SIG_IGN}
    signal.set_wakeup_fd(-1)
    for number in ending:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ending)


def _address_space() -> int:
    """Return the address space of this process, bytes; 0 where the system does not say it."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    except (OSError, ValueError):
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


def lower_limit(limit: int, value: int) -> None:
    """Set a limit of this process for good, where the system does not have a lower one already."""
    import resource

    now, _ = resource.getrlimit(limit)
    if now == resource.RLIM_INFINITY or value < now:
        try:
            resource.setrlimit(limit, (value, value))
        except (ValueError, OSError):
            return  # macOS knows some limits and sets none


def forbid_writing_and_network() -> int:
    """Forbid this process what landlock can, for good; return its version, 0 where the kernel has none."""
    if sys.platform != "linux":
        return 0
    system = ctypes.CDLL(None, use_errno=True)
    version = int(system.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), ctypes.c_uint32(_ASK_VERSION)))
    if version < 1:
        return 0  # not built in, or switched off
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
