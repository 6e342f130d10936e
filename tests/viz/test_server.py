"""The server of the live viewer listens where it is asked to, and says what is open."""

import socket
from urllib.parse import urlsplit
from urllib.request import urlopen

import pytest

import ngalpha_pin as nga
from ngalpha_pin.viz.server import start_server, what_is_open


def test_server_is_there_for_this_machine_alone():
    commands, page = start_server()
    assert urlsplit(commands).hostname == urlsplit(page).hostname == "127.0.0.1"
    with urlopen(page, timeout=20) as answer:
        assert answer.status == 200
    # every address 127.x.y.z is this machine, but only the one that was asked for is listened to
    with socket.socket() as other, pytest.raises(ConnectionRefusedError):
        other.connect(("127.0.0.2", urlsplit(page).port))
    assert "this machine alone" in what_is_open(page, "127.0.0.1")


def test_server_for_the_network_says_so():
    _, page = start_server("0.0.0.0")
    with socket.socket() as other:
        other.connect(("127.0.0.2", urlsplit(page).port))
    assert "everybody who can reach 0.0.0.0" in what_is_open(page, "0.0.0.0")


@pytest.mark.parametrize(("address", "words"), [("everywhere", "no IP address"), ("203.0.113.1", "cannot be served")])
def test_addresses_that_are_none_of_this_machine(address, words):
    with pytest.raises(nga.NgalphaError, match=words):
        start_server(address)
