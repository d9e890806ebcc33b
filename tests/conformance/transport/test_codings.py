"""Coded contents are decoded within a budget."""

import gzip

from conformance.transport.codings import content_of


def test_members_of_gzip_are_one_content_up_to_a_hundred():
    member = gzip.compress(b"a")
    assert content_of(member * 99, "gzip", is_whole=True).octets == b"a" * 99
    many = content_of(member * 100_000, "gzip", is_whole=True)  # each member copies what is left
    assert (many.is_plain, many.octets) == (False, member * 100_000)
