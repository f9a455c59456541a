"""Where a page is served, and what is shown of that."""

import pytest

from mpucal.page.address import Address, address, lan_host


def test_it_is_this_computer_unless_the_network_is_asked_for():
    assert address("127.0.0.1") == Address("127.0.0.1", 0, "127.0.0.1")
    assert address("lan").host == lan_host()
    assert address("192.168.1.20:8000") == Address("192.168.1.20", 8000, "192.168.1.20")
    assert address("[::1]:8000") == Address("::1", 8000, "[::1]")
    assert address("0.0.0.0:8000") == Address("0.0.0.0", 8000, lan_host())


@pytest.mark.parametrize("text", ["", "8000", ":8000", "host", "host:", "host:http", "host:70000", "host:-1", "host:²"])
def test_anything_else_is_a_sentence(text):
    with pytest.raises(ValueError, match="is no address for a page"):
        address(text)
