"""Addresses of a page, as a person gives them."""

import pytest

from mpucal.page.address import Address, lan_host, parse_address


def test_the_address_is_local_unless_the_network_is_given():
    assert parse_address("127.0.0.1") == Address("127.0.0.1", 0, "127.0.0.1")
    assert parse_address("lan").host == lan_host()
    assert parse_address("192.168.1.20:8000") == Address("192.168.1.20", 8000, "192.168.1.20")
    assert parse_address("[::1]:8000") == Address("::1", 8000, "[::1]")
    assert parse_address("0.0.0.0:8000") == Address("0.0.0.0", 8000, lan_host())


@pytest.mark.parametrize("text", ["", "8000", ":8000", "host", "host:", "host:http", "host:70000", "host:-1", "host:²"])
def test_anything_else_is_a_sentence(text):
    with pytest.raises(ValueError, match="is not an address for a page"):
        parse_address(text)
