"""What is raised and warned of: diagnostics with a file, a place and a code (docs/diagnostics.md)."""
from typing import NamedTuple


class Diagnostic(NamedTuple):
    """One thing that was said of a scene, a file or a connection. Line and column count from 1; 0: none."""
    severity: str
    text: str
    file: str
    line: int
    column: int
    code: str

    def __str__(self):
        return f"{_place(self.file, self.line, self.column)}{self.severity}: {self.text} [{self.code}]"


def _place(file, line, column):
    place = ":".join(str(part) for part in (file, line or "", column or "") if part != "")
    return f"{place}: " if place else ""


class Error(Exception):
    """A call failed: `text`, where it is known in which `file`, `line` and `column` (from 1; 0: none), and the `code`."""

    def __init__(self, text, file="", line=0, column=0, code="application"):
        super().__init__(text, file, line, column, code)
        self.text, self.file, self.line, self.column, self.code = text, file, line, column, code

    def __str__(self):
        return f"{_place(self.file, self.line, self.column)}{self.text} [{self.code}]"


class NoSuchName(Error, KeyError):
    """There is no node of that name, or none any more."""


class NoSuchField(Error, AttributeError):
    """The node's type has no field of that name."""


class WrongThread(Error):
    """A scene belongs to the thread that made it, and this is another one."""


class Closed(Error):
    """The scene, log or connection was closed, or the interpreter ends."""


class NoExtension(Error, AttributeError):
    """What only the extension module does, where it is not installed: see rtsg.native."""


class DiagnosticWarning(UserWarning):
    """Something was said of a scene that is no reason to stop: an error in part of it, a warning."""
