"""The command `vibroimpact`: one app; `table` names the commands, and another package can add its own.

A function in the entry-point group `vibroimpact.commands` is called with the app, unless the command is one of this
package.
"""

from __future__ import annotations

import _thread
import atexit
import copy
import errno
import functools
import gc
import itertools
import logging
import operator
import os
import signal
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import metadata
from types import FrameType
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from vibroimpact.fmus.errors import UsageError, VibroimpactError
from vibroimpact.fmus.file_names import refuse_no_text
from vibroimpact.fmus.printable import printable
from vibroimpact.fmus.terminal import all_was_written, say
from vibroimpact.orchestrator.commands.table import COMMANDS, GROUPS
from vibroimpact.orchestrator.commands.typer_form import ORDER, add_commands

COMMAND_GROUP = "vibroimpact.commands"
DEBUG = "--debug"
_FULL = frozenset({errno.ENOSPC, errno.EDQUOT})
_FEW_DESCRIPTORS = frozenset({errno.EMFILE, errno.ENFILE})
_IMPORTING = "<frozen importlib._bootstrap>"
_COLLECT_AFTER = 10_000
"""New objects after which Python collects garbage; its own default is 700 or 2000."""
_SOON = 0.02
"""Delay after which a lost interrupt is raised again, s."""


@contextmanager
def _printable_misuse() -> Iterator[None]:
    """Make the words of a misused command printable, as `say` does; typer repeats them unchanged."""
    try:
        yield
    except Exception as problem:
        # misuse: its class is typer's or click's, depending on the version
        if hasattr(problem, "format_message") and hasattr(problem, "message"):
            problem.message = printable(problem.message)
        raise


class _Commands(TyperGroup):
    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        with _printable_misuse():
            return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        with _printable_misuse():
            return super().invoke(ctx)

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the commands in the order of their panels; other packages' commands come last."""
        return sorted(self.commands, key=[*ORDER, *self.commands].index)


app = typer.Typer(
    name="vibroimpact",
    cls=_Commands,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Dynamics of things that vibrate and hit stops.",
)


def _show_version(requested: bool) -> None:
    if requested:
        say(f"vibroimpact {metadata.version('vibroimpact')}")
        raise typer.Exit


@app.callback()
def _options(
    debug: Annotated[bool, typer.Option(DEBUG, help="Show where in the program an error arose.")] = False,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Dynamics of things that vibrate and hit stops."""


@functools.cache
def load_commands() -> None:
    """Add every command to the app, once in a process: those of this package, then those of others."""
    add_commands(app)
    _add_foreign(app)


def _add_foreign(app: typer.Typer) -> None:
    for entry in sorted(metadata.entry_points(group=COMMAND_GROUP), key=lambda entry: entry.name):
        entry.load()(app)


def _with_called(words: Sequence[str]) -> typer.Typer:
    """Return an app with the called command; for a command of no name in this package, with all commands."""
    named = list(itertools.filterfalse(operator.methodcaller("startswith", "-"), words))
    called = copy.copy(app)
    if named and named[0] in COMMANDS.keys() | GROUPS.keys():
        called.registered_commands, called.registered_groups = [], []
    else:
        called.registered_commands, called.registered_groups = (
            app.registered_commands[:],
            app.registered_groups[:],
        )
        _add_foreign(called)
        gc.enable()  # commands of others may keep no modules out of a collection
    add_commands(called, named)
    return called


@contextmanager
def _no_vain_collections(*, is_own_process: bool) -> Iterator[None]:
    """Collect garbage less often, and not at the end of the process.

    Imports make some 300,000 objects that stay. Repeated collections over them take a tenth of a short command. A
    process of its own begins to collect when the command's modules are in, and leaves their objects out.
    """
    atexit.register(gc.freeze)
    usual = gc.get_threshold()
    gc.set_threshold(_COLLECT_AFTER, *usual[1:])
    if is_own_process:
        gc.disable()
    try:
        yield
    finally:
        gc.set_threshold(*usual)
        if is_own_process:
            gc.freeze()
            gc.enable()


@contextmanager
def _no_library_warns() -> Iterator[None]:
    """Hide warnings of libraries: they are for developers, and a command prints what its user needs.

    The filter comes last, so that `python -W`, PYTHONWARNINGS and tests can override it.
    """
    silent = logging.NullHandler()
    logging.getLogger().addHandler(silent)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", append=True)
            yield
    finally:
        logging.getLogger().removeHandler(silent)


@contextmanager
def _no_interrupt_is_lost() -> Iterator[None]:
    """Raise an interrupt that would be lost again, a moment later.

    An interrupt is lost in two places. First, a compiled module may report an ImportError when its import is
    interrupted. Its Python half then does without it (`xml.etree` does so). Second, an exception in `__del__`, or in
    another function whose caller cannot raise, is ignored.
    """
    handler, ignored = signal.getsignal(signal.SIGINT), sys.unraisablehook
    # an ignored Ctrl-C, or one that another program handles, stays so
    if handler is not signal.default_int_handler or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGINT, _interrupt)
    sys.unraisablehook = functools.partial(_ignore, ignored)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        sys.unraisablehook = ignored


def _interrupt(number: int, place: FrameType | None) -> None:
    frames = (frame for frame, _ in traceback.walk_stack(place))
    ours = itertools.takewhile(lambda frame: frame.f_code is not main.__code__, frames)
    if all(frame.f_code.co_filename != _IMPORTING for frame in ours):
        raise KeyboardInterrupt
    _interrupt_soon()


def _ignore(otherwise: Callable[[Any], object], unraisable: Any) -> None:
    if issubclass(unraisable.exc_type, KeyboardInterrupt):
        _interrupt_soon()
    else:
        otherwise(unraisable)


def _interrupt_soon() -> None:
    # `threading.Timer` would wait for a lock that the interrupted code may hold
    _thread.start_new_thread(_interrupt_after, (_SOON,))


def _interrupt_after(seconds: float) -> None:
    time.sleep(seconds)
    _thread.interrupt_main()


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code: 0 done, 1 failed, 2 misused, 130 interrupted."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        for word in given:
            refuse_no_text(word)
        own = arguments is None
        with _no_interrupt_is_lost(), _no_vain_collections(is_own_process=own), _no_library_warns():
            # typer reports misuse (2) and Ctrl-C (130) by itself; our own errors come out
            typer.main.get_command(_with_called(given)).main(args=given, prog_name="vibroimpact")
    except SystemExit as end:
        sys.exit(end.code or (0 if all_was_written() else 1))
    except KeyboardInterrupt:
        sys.exit(130)
    except Exception as error:
        if DEBUG in given:
            say(traceback.format_exc(), err=True)
        error = _of_surroundings(error) or error
        say(_words(error, debug=DEBUG in given), err=True)
        sys.exit(error.exit_code if isinstance(error, VibroimpactError) else 1)


def _of_surroundings(error: Exception) -> UsageError | None:
    """Return the error of the command's surroundings if they caused another error, else None."""
    causes = list(_causes(error))
    numbers = {cause.errno for cause in causes if isinstance(cause, OSError)}
    # a compiled module that cannot be opened is an ImportError, with no errno
    if numbers & _FEW_DESCRIPTORS or os.strerror(errno.EMFILE) in str(error):
        return UsageError(
            "this machine: expected another file that may be opened, got too many open ones. "
            "Raise the limit (`ulimit -n 1024`), or end other programs."
        )
    if errno.ENOENT in numbers and not isinstance(error, VibroimpactError) and _no_current_folder():
        return UsageError(
            "current folder: expected one that exists, got one that was removed. "
            "Change to another, or give absolute paths."
        )
    return None


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error, its cause, and so on."""
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def _no_current_folder() -> bool:
    try:
        os.getcwd()
    except OSError:
        return True
    return False


def _words(error: Exception, *, debug: bool) -> str:
    """Return the message of an error; for an unexpected one with advice on how to report it."""
    if isinstance(error, VibroimpactError):
        from vibroimpact.analysis.files.scratch import with_names

        return with_names(error.typed)
    if isinstance(error, OSError) and error.errno in _FULL:
        return f"{error.filename or 'Output'}: cannot be written ({error.strerror})."
    hint = "" if debug else f" Repeat the command as `vibroimpact {DEBUG} ...` and report what it shows."
    return f"Unexpected error: {type(error).__name__}: {error}\nThis is a defect of vibroimpact.{hint}"


if __name__ == "__main__":
    main()
