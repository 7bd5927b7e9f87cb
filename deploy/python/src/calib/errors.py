"""What can go wrong, a class per kind. The message is the sentence of the service or the program."""

from __future__ import annotations

from typing import TypedDict


class Problem(TypedDict):
    """One thing wrong in a campaign file or a file that it names."""

    file: str
    line: int  # from 1; 0: the file as a whole
    key: str  # dotted path of the key, or the name of a column
    message: str  # what is wrong and what is allowed


class CalibError(Exception):
    """Any of the errors below."""


class BadInput(CalibError):
    """A file or an argument that is refused. `problems` has one entry per problem of a file."""

    def __init__(self, message: str, problems: list[Problem] | None = None) -> None:
        super().__init__(message)
        self.problems: list[Problem] = problems or []


class NotFound(CalibError):
    """No such campaign, sample or worker."""


class NotNow(CalibError):
    """Not possible in the state that the campaign or the file is in; the message says which."""


class Conflict(CalibError):
    """There is something else of this name already."""


class NotAuthenticated(CalibError):
    """Neither a certificate of the server's authority nor its token was shown."""


class NotAllowed(CalibError):
    """The caller's role does not do this, or the campaign is somebody else's."""


class Unreachable(CalibError):
    """No server answers, or the connection was lost and did not come back."""


class TooLate(Unreachable):
    """The server is there and did not answer in time."""


class NotTrusted(Unreachable):
    """What answers is not the server of the certificate: another authority or host, revoked, plain text."""


class ServerFull(CalibError):
    """The server takes no more now: too many calls, a full disk. Try later."""


class Damaged(CalibError):
    """What is stored breaks a rule of the answer."""


class RequestFailed(CalibError):
    """The campaign or the request failed."""


class ProgramMissing(CalibError):
    """calibctl, calibd or calib-worker is neither in the folder that was named nor on the PATH."""
