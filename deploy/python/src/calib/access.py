"""What is shown to a server, found where the programs find it.

A certificate: the folder that `calibctl certs issue` has written (`tls`, else $CALIB_TLS). A token:
a file (`token`), $CALIB_TOKEN (the token or a file that holds it), else what a server of this
account has left in $XDG_RUNTIME_DIR/calib or ~/.cache/calib. A Unix socket asks for nothing.
"""

from __future__ import annotations

import dataclasses
import ipaddress
import os
import re
from pathlib import Path

from calib.errors import BadInput

TOKEN = re.compile(r"[0-9a-f]{64}")
LONGEST_TOKEN_FILE = 4096  # bytes
LONGEST_SOCKET_PATH = 107  # bytes, of sun_path [unix(7)]
LISTENS = "0A"  # state of a socket in /proc/net/tcp [proc(5)]


@dataclasses.dataclass(frozen=True)
class Access:
    """What is shown with each connection or call."""

    tls: Path | None = None  # folder of a certificate; None: plain text
    token: str | None = None  # 64 hexadecimal digits
    own_port: int = 0  # the token is not shown while another account listens there; 0: to whoever answers


def problem_of_address(address: str) -> str:
    """A sentence where `address` is neither HOST:PORT nor unix:/PATH; else empty."""
    if address.startswith("unix:"):
        path = address.removeprefix("unix:")
        if path.startswith("/") and len(os.fsencode(path)) <= LONGEST_SOCKET_PATH:
            return ""
        return f"'{address}' is not unix:/PATH with a path of at most {LONGEST_SOCKET_PATH} bytes"
    host, _, port = address.rpartition(":")
    in_brackets = re.fullmatch(r"\[[0-9a-fA-F:.%]+\]", host) is not None
    is_host = in_brackets or re.fullmatch(r"[^:/\[\]@\s]+", host) is not None
    if is_host and re.fullmatch(r"[0-9]{1,5}", port) and 1 <= int(port) <= 65535:
        return ""
    return f"'{address}' is not HOST:PORT with a port from 1 to 65535"


def is_socket(address: str) -> bool:
    """Whether the address is that of a Unix socket."""
    return address.startswith("unix:")


def host_and_port(address: str) -> tuple[str, int]:
    """Of HOST:PORT, brackets around an IPv6 address taken off."""
    host, _, port = address.rpartition(":")
    return host.strip("[]"), int(port)


def is_loopback(address: str) -> bool:
    """Whether only this machine is reached by the address. Names are not looked up."""
    if is_socket(address):
        return True
    host, _ = host_and_port(address)
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def read_token(path: Path) -> str:
    """The token in a file. BadInput: it cannot be read or holds none."""
    try:
        with path.open("rb") as file:
            token = file.read(LONGEST_TOKEN_FILE).decode("ascii", "replace").strip()
    except OSError as error:
        name = "the file of the token" if re.search(r"[0-9a-fA-F]{32}", str(path)) else str(path)
        raise BadInput(f"{name} cannot be read: {error.strerror}") from None
    if TOKEN.fullmatch(token) is None:
        raise BadInput(f"{path} holds no token, which has 64 hexadecimal digits; "
                       "calibd writes one to `token` of its state folder")
    return token


def token_folders() -> list[Path]:
    """Where servers of this account leave their tokens, as PORT.token; the best first."""
    folders = []
    if runtime := os.environ.get("XDG_RUNTIME_DIR"):
        folders.append(Path(runtime) / "calib")
    if home := os.environ.get("HOME"):
        folders.append(Path(home) / ".cache" / "calib")
    return folders


def another_account_listens(port: int) -> bool:
    """Whether what listens at a TCP port of this machine belongs to another account."""
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        try:
            lines = Path(table).read_text(encoding="ascii").splitlines()[1:]
        except OSError:
            continue
        for line in lines:  # sl, local address:port, remote, state, queues, timer, retransmits, account
            columns = line.split()
            if columns[3] == LISTENS and int(columns[1].rpartition(":")[2], 16) == port and int(columns[7]) != os.geteuid():
                return True
    return False


def _left_token(port: int) -> str | None:
    newest: tuple[int, str] | None = None
    for folder in token_folders():
        path = folder / f"{port}.token"
        try:
            found = (path.stat().st_mtime_ns, read_token(path))
        except (OSError, BadInput):
            continue
        if newest is None or found[0] >= newest[0]:
            newest = found
    return newest[1] if newest else None


def find_access(address: str, tls: Path | None, token: Path | None, *, own: bool = False) -> Access:
    """What this process has for the server at `address`.

    own: the token is of a server of this account. BadInput: a file that is named and cannot be
    read or holds no token, a folder that is none of a certificate.
    """
    if is_socket(address):
        return Access()
    if tls is None and (variable := os.environ.get("CALIB_TLS")):
        tls = Path(variable)
    if tls is not None:
        for name in ("ca.pem", "cert.pem", "key.pem"):
            if not os.access(tls / name, os.R_OK):
                reason = "Permission denied" if (tls / name).exists() else "No such file or directory"
                raise BadInput(f"{tls / name} cannot be read: {reason}; tls names a folder that `calibctl certs issue` has written")
        if token is None:
            return Access(tls=tls)
    if token is not None:
        return Access(tls=tls, token=read_token(token), own_port=host_and_port(address)[1] if own else 0)
    if variable := os.environ.get("CALIB_TOKEN", "").strip():
        if TOKEN.fullmatch(variable):
            return Access(token=variable)
        try:
            return Access(token=read_token(Path(variable)))
        except BadInput:  # without the value, which may be a token that was not copied whole
            raise BadInput("$CALIB_TOKEN is neither a token (64 hexadecimal digits in lower case) nor the name of a file "
                           "that holds one") from None
    if not is_loopback(address):
        return Access()
    port = host_and_port(address)[1]
    left = _left_token(port)
    return Access(token=left, own_port=port) if left else Access()
