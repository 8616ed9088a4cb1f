"""A forked copy of the collecting process: it runs the tests that it is given and reports their outcomes."""

from __future__ import annotations

import gc
import io
import os
import sys
import traceback
import warnings
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NoReturn

import pytest
from _pytest._io import TerminalWriter


class _Reporter:
    """The plugin that passes on the terminal's events."""

    def __init__(self, config: pytest.Config, link: Connection) -> None:
        self._config, self._link = config, link
        self.listens = False
        """Whether warnings are passed on; pytest replays earlier ones to every new plugin, before this is set."""

    def pytest_runtest_logstart(self, nodeid: str, location: tuple[str, int | None, str]) -> None:
        self._link.send(("start", {"nodeid": nodeid, "location": location}))

    def pytest_runtest_logfinish(self, nodeid: str, location: tuple[str, int | None, str]) -> None:
        self._link.send(("finish", {"nodeid": nodeid, "location": location}))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        data = self._config.hook.pytest_report_to_serializable(config=self._config, report=report)
        self._link.send(("report", data))

    def pytest_warning_recorded(
        self,
        warning_message: warnings.WarningMessage,
        when: str,
        nodeid: str,
        location: tuple[str, int, str] | None,
    ) -> None:
        if not self.listens:
            return
        # the warning's own class may not be serializable
        text = f"{warning_message.category.__name__}: {warning_message.message}"
        plain = warnings.WarningMessage(
            Warning(text), Warning, warning_message.filename, warning_message.lineno
        )
        given = {"warning_message": plain, "when": when, "nodeid": nodeid, "location": location}
        self._link.send(("warning", given))


class _NoTerminal:
    """Replaces the terminal reporter, which pytest asks for the colours of its explanations."""

    def __init__(self) -> None:
        self._tw = TerminalWriter(io.StringIO())


def run_share(session: pytest.Session, link: Connection, folder: Path) -> NoReturn:
    """Run tests until no more numbers come; then end this process without the parent's exit handlers."""
    code = 1
    try:
        _become_a_worker(session.config, link, folder)
        try:
            _run(session, link)
        finally:
            session._setupstate.teardown_exact(None)
        merged: dict[str, Any] = {}
        for part in session.config.hook.pytest_handed_over(config=session.config):
            merged |= part
        link.send(("end", merged))
        code = 0
    except (KeyboardInterrupt, EOFError, BrokenPipeError, ConnectionResetError):
        code = 130  # the collecting process has received the signal too, or has ended
    except BaseException:
        traceback.print_exc(file=sys.__stderr__)
    finally:
        os._exit(code)


def _become_a_worker(config: pytest.Config, link: Connection, folder: Path) -> None:
    gc.freeze()
    gc.enable()
    plugins: Any = config.pluginmanager
    plugins.unregister(name="terminalreporter")
    plugins.register(_NoTerminal(), "terminalreporter")
    reporter = _Reporter(config, link)
    plugins.register(reporter)
    reporter.listens = True
    capture = plugins.getplugin("capturemanager")
    # all copies share the files of captured output
    capture.stop_global_capturing()
    capture.start_global_capturing()
    capture.suspend_global_capture()
    folder.mkdir(exist_ok=True)
    config._tmp_path_factory._basetemp = folder  # type: ignore[attr-defined]


def _run(session: pytest.Session, link: Connection) -> None:
    number = link.recv()
    while number is not None:
        link.send(("begun", number))
        following = link.recv()
        nextitem = None if following is None else session.items[following]
        item = session.items[number]
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=nextitem)
        number = following
