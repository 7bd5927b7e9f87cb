"""Who is let in: tokens and certificates, found and shown as the programs do."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

import calib
from conftest import PROGRAMS, Daemon, calibctl, small_campaign

Start = Callable[..., Daemon]


def certificate(folder: Path, role: str, name: str, *options: str, authority: str = "ca") -> Path:
    """A certificate of an authority, both made if need be."""
    if not (folder / authority).exists():
        calibctl("certs", "init", folder / authority)
    calibctl("certs", "issue", folder / authority, "--role", role, name, *options, "-o", folder / name)
    return folder / name


def test_the_token_is_found_where_the_server_leaves_it(daemon: Start, account: Path, monkeypatch: pytest.MonkeyPatch,
                                                       tmp_path: Path) -> None:
    server = daemon("state")
    with calib.connect(server.address, programs=PROGRAMS) as client:
        assert client.status(client.submit(small_campaign(tmp_path)))["state"] in ("queued", "running")
    monkeypatch.setenv("HOME", str(tmp_path))  # another account's: nothing was left there
    with pytest.raises(calib.NotAuthenticated):
        calib.connect(server.address)
    token = server.state / "token"
    calib.connect(server.address, token=token).close()
    monkeypatch.setenv("CALIB_TOKEN", token.read_text())
    calib.connect(server.address).close()
    monkeypatch.setenv("CALIB_TOKEN", str(token))
    calib.connect(server.address).close()


def test_what_is_no_token_is_said_and_not_repeated(daemon: Start, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    server = daemon("state")
    (tmp_path / "wrong").write_text("secret")
    with pytest.raises(calib.BadInput, match="holds no token"):
        calib.connect(server.address, token=tmp_path / "wrong")
    with pytest.raises(calib.BadInput, match="cannot be read: No such file"):
        calib.connect(server.address, token=tmp_path / "nothing")
    (tmp_path / "other").write_text("0" * 64)
    with pytest.raises(calib.NotAuthenticated):
        calib.connect(server.address, token=tmp_path / "other")
    almost = (server.state / "token").read_text().strip()[:-1]
    monkeypatch.setenv("CALIB_TOKEN", almost)
    with pytest.raises(calib.BadInput, match="neither a token") as refused:
        calib.connect(server.address)
    assert almost not in str(refused.value)


def test_a_certificate_is_shown_and_its_role_counts(daemon: Start, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    server = daemon("state", "--tls", certificate(tmp_path, "server", "node", "--host", "127.0.0.1"))
    submitter = certificate(tmp_path, "submitter", "ana")
    viewer = certificate(tmp_path, "viewer", "vito")
    with calib.connect(server.address, tls=submitter, programs=PROGRAMS) as client:
        campaign = client.submit(small_campaign(tmp_path))
        assert client.status(campaign)["owner"] == "ana"
    monkeypatch.setenv("CALIB_TLS", str(viewer))
    with calib.connect(server.address, programs=PROGRAMS) as client:
        assert client.samples(campaign).parameters.attrs["units"]["young_modulus"] == "Pa"
        with pytest.raises(calib.NotAllowed):
            client.cancel(campaign)
        with pytest.raises(calib.RequestFailed, match="viewer"):
            client.submit(small_campaign(tmp_path, seed=9))
    monkeypatch.delenv("CALIB_TLS")
    with pytest.raises(calib.Unreachable, match="does not answer as calibd does in plain text"):
        calib.connect(server.address)


def test_a_server_that_is_not_the_one_is_not_taken(daemon: Start, tmp_path: Path) -> None:
    node = certificate(tmp_path, "server", "node", "--host", "127.0.0.1")
    server = daemon("state", "--tls", node)
    ana = certificate(tmp_path, "submitter", "ana")
    with pytest.raises(calib.NotTrusted, match="self-signed|unable to get local issuer"):
        calib.connect(server.address, tls=certificate(tmp_path, "submitter", "eve", authority="other"))
    with pytest.raises(calib.NotTrusted, match="127.0.0.2"):  # for which it was not issued
        calib.connect(daemon("elsewhere", "--tls", node, listen="127.0.0.2:0").address, tls=ana)
    with pytest.raises(calib.NotTrusted, match="not as a server with certificates"):
        calib.connect(daemon("plain").address, tls=ana)
    calib.connect(server.address, tls=ana).close()
    calibctl("certs", "revoke", tmp_path / "ca", "node")
    (ana / "crl.pem").write_bytes((tmp_path / "ca" / "crl.pem").read_bytes())
    with pytest.raises(calib.NotTrusted, match="revoked"):
        calib.connect(server.address, tls=ana)
    os.remove(ana / "crl.pem")
    with pytest.raises(calib.NotTrusted, match="no list of revocations"):
        calib.connect(server.address, tls=ana)


def test_a_state_folder_wants_neither_certificate_nor_token(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CALIB_TLS", str(certificate(tmp_path, "viewer", "vito")))
    monkeypatch.setenv("CALIB_TOKEN", "0" * 64)
    with calib.connect(state=tmp_path / "state", programs=PROGRAMS, workers=1) as client:
        assert client.address.startswith("unix:/")
        assert client.wait(client.submit(small_campaign(tmp_path, samples=2, iterations=1)))["samples_done"] == 2


def test_a_folder_that_is_no_certificate_is_said(tmp_path: Path) -> None:
    with pytest.raises(calib.BadInput, match="ca.pem cannot be read: No such file or directory"):
        calib.connect("127.0.0.1:9", tls=tmp_path)


def test_a_token_of_this_account_is_not_shown_to_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from calib import access

    lines = ["  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode",
             f"   0: 0100007F:1D13 00000000:0000 0A 00000000:00000000 00:00000000 00000000 {os.geteuid() + 1} 0 1"]
    monkeypatch.setattr(access.Path, "read_text", lambda self, encoding: "\n".join(lines))
    assert access.another_account_listens(0x1D13)
    assert not access.another_account_listens(0x1D14)
