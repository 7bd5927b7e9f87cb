"""Calls of the service: a channel, deadlines, repeats, and errors as exceptions of `calib.errors`."""

from __future__ import annotations

import os
import random
import socket
import ssl
import time
from collections.abc import Callable, Iterator
from typing import Any, TypeVar, cast

os.environ.setdefault("GRPC_VERBOSITY", "NONE")  # what goes wrong is raised, in a sentence

import grpc

from calib import errors
from calib.access import Access, another_account_listens, host_and_port, is_socket
from calib.v1 import campaign_pb2_grpc

CONNECT = 1.8  # s until a server that is there has answered
HANDSHAKE = 2.0  # s
DEADLINE = 30.0  # s for a question, as of the programs (proto/rpc/client_options.h)
STREAM_DEADLINE = 600.0  # s for a stream that ends
RETURN = 60.0  # s in which a server that was lost may come back
LONGEST_WAIT = 2.0  # s between tries

# As of the programs (proto/rpc/client_options.cc): quick reconnects, keep-alive, no proxy between programs of one machine.
OPTIONS = [
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.min_reconnect_backoff_ms", 1000),
    ("grpc.max_reconnect_backoff_ms", 2000),
    ("grpc.keepalive_time_ms", 20_000),
    ("grpc.keepalive_timeout_ms", 10_000),
    ("grpc.http2.max_pings_without_data", 0),
    ("grpc.use_local_subchannel_pool", 1),
    ("grpc.enable_http_proxy", 0),
]

KINDS: dict[grpc.StatusCode, type[errors.CalibError]] = {
    grpc.StatusCode.INVALID_ARGUMENT: errors.BadInput,
    grpc.StatusCode.OUT_OF_RANGE: errors.BadInput,
    grpc.StatusCode.NOT_FOUND: errors.NotFound,
    grpc.StatusCode.FAILED_PRECONDITION: errors.NotNow,
    grpc.StatusCode.ALREADY_EXISTS: errors.Conflict,
    grpc.StatusCode.UNAUTHENTICATED: errors.NotAuthenticated,
    grpc.StatusCode.PERMISSION_DENIED: errors.NotAllowed,
    grpc.StatusCode.UNAVAILABLE: errors.Unreachable,
    grpc.StatusCode.CANCELLED: errors.Unreachable,  # by a server that ends
    grpc.StatusCode.DEADLINE_EXCEEDED: errors.TooLate,
    grpc.StatusCode.RESOURCE_EXHAUSTED: errors.ServerFull,
    grpc.StatusCode.DATA_LOSS: errors.Damaged,
}
LOST = (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED)

Reply = TypeVar("Reply")
# A connection's address, what is shown there, and whether that may be something else after a refusal.
FindAccess = Callable[[], Access]


def raised(error: grpc.RpcError) -> errors.CalibError:
    """The exception for a call that failed."""
    kind = KINDS.get(error.code(), errors.RequestFailed)
    return kind(error.details() or error.code().name.lower())


def check_server(address: str, access: Access) -> None:
    """Takes a server that is certified for the host of the address by the authority of the folder and not revoked.

    gRPC checks authority and host at each connection; the list of revocations (crl.pem) is held
    against the server here, each time this process connects. NotTrusted otherwise.
    """
    if access.tls is None:
        return
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    revocations = access.tls / "crl.pem"
    try:
        context.load_verify_locations(access.tls / "ca.pem")
        context.load_cert_chain(access.tls / "cert.pem", access.tls / "key.pem")
        if not revocations.exists():
            raise errors.NotTrusted(f"{revocations} holds no list of revocations in PEM: without one no server is taken")
        context.load_verify_locations(revocations)
    except ssl.SSLError as error:
        raise errors.BadInput(f"the certificate in {access.tls} cannot be used: {error.reason}") from None
    context.set_alpn_protocols(["h2"])
    context.verify_flags |= ssl.VERIFY_CRL_CHECK_LEAF
    host, port = host_and_port(address)
    try:
        with socket.create_connection((host, port), timeout=HANDSHAKE) as plain, \
                context.wrap_socket(plain, server_hostname=host):
            return
    except ssl.SSLCertVerificationError as error:
        raise errors.NotTrusted(f"{address} shows a certificate that is not taken: {error.verify_message}") from None
    except ssl.SSLError as error:
        raise errors.NotTrusted(f"{address} answers, and not as a server with certificates does: {error.reason}") from None
    except OSError:
        raise errors.Unreachable(f"no server answers at {address}") from None


class Channel:
    """Calls of one server. Not thread-safe."""

    def __init__(self, address: str, find_access: FindAccess) -> None:
        """Unreachable within about two seconds where nothing answers at the address."""
        self.address = address
        self._find_access = find_access
        self._open(find_access())
        try:
            grpc.channel_ready_future(self._channel).result(timeout=CONNECT)
        except grpc.FutureTimeoutError:
            self.close()
            raise errors.Unreachable(self._why_not_connected()) from None

    def close(self) -> None:
        """Ends the connection."""
        self._channel.close()

    def _open(self, access: Access) -> None:
        check_server(self.address, access)
        self._access = access
        if access.tls is None:
            self._channel = grpc.insecure_channel(self.address, options=OPTIONS)
        else:
            credentials = grpc.ssl_channel_credentials(
                root_certificates=(access.tls / "ca.pem").read_bytes(),
                private_key=(access.tls / "key.pem").read_bytes(),
                certificate_chain=(access.tls / "cert.pem").read_bytes())
            self._channel = grpc.secure_channel(self.address, credentials, options=OPTIONS)
        self._stub: Any = campaign_pb2_grpc.CampaignsStub(self._channel)  # type: ignore[no-untyped-call]

    def _why_not_connected(self) -> str:
        if not is_socket(self.address):
            try:
                socket.create_connection(host_and_port(self.address), timeout=HANDSHAKE).close()
                return (f"{self.address} takes connections, and does not answer as calibd does in plain text: one with "
                        "certificates wants one of its authority (tls, a folder from `calibctl certs issue`)")
            except OSError:
                pass
        return (f"no server answers at {self.address}; start one with `calibd --state DIR`, name another with server, or "
                "work on a folder with state")

    def _metadata(self) -> list[tuple[str, str]]:
        token, port = self._access.token, self._access.own_port
        if token is None or (port and another_account_listens(port)):
            return []
        return [("authorization", f"Bearer {token}")]

    def _shows_another(self) -> bool:
        """After what was shown was refused: whether something else can be shown by now, over a new connection."""
        access = self._find_access()
        if access == self._access and access.tls is None:
            return False
        self._channel.close()
        self._open(access)
        return True

    def _again(self, error: grpc.RpcError, since: float, tries: int) -> bool:
        """Whether a call that failed is made again, after a wait where that helps."""
        code = error.code()
        if code == grpc.StatusCode.UNAUTHENTICATED:
            return tries == 1 and self._shows_another()
        if code not in LOST or time.monotonic() - since > RETURN:
            return False
        time.sleep(random.uniform(0, min(LONGEST_WAIT, 0.1 * 2.0**tries)))
        if self._access.tls is not None:  # who has come back is looked at like a new one
            try:
                check_server(self.address, self._access)
            except errors.NotTrusted:
                raise
            except errors.Unreachable:
                pass
        return True

    def ask(self, method: str, request: object, reply: type[Reply]) -> Reply:
        """One call with one answer; made again for a minute where the connection is lost."""
        since = time.monotonic()
        tries = 0
        while True:
            tries += 1
            try:
                answer = getattr(self._stub, method)(request, timeout=DEADLINE, metadata=self._metadata())
                return cast(Reply, answer)
            except grpc.RpcError as error:
                if not self._again(error, since, tries):
                    raise raised(error) from None

    def collect(self, method: str, request: object, message: type[Reply]) -> list[Reply]:
        """All messages of a stream that ends by itself; asked for again as a whole where the connection is lost."""
        since = time.monotonic()
        tries = 0
        while True:
            tries += 1
            try:
                return list(getattr(self._stub, method)(request, timeout=STREAM_DEADLINE, metadata=self._metadata()))
            except grpc.RpcError as error:
                if not self._again(error, since, tries):
                    raise raised(error) from None

    def follow(self, method: str, request: object, message: type[Reply]) -> Iterator[Reply]:
        """The messages of a stream as they come, over lost connections; ended when the iterator is closed."""
        since = time.monotonic()
        tries = 0
        while True:
            tries += 1
            call: Any = getattr(self._stub, method)(request, metadata=self._metadata())
            try:
                for one in call:
                    yield cast(Reply, one)
                    since, tries = time.monotonic(), 0
                return
            except grpc.RpcError as error:
                if not self._again(error, since, tries):
                    raise raised(error) from None
            finally:
                call.cancel()
