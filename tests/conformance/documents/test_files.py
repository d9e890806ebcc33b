"""Small files are read by what reads such files, and contain the octets that were asked for."""

import gzip
import io
import wave
import zipfile
import zlib
from struct import unpack

import pytest

from conformance.documents.files import file_of, is_made, keeps_octets

_OCTETS = bytes(range(256)) * 3


def _chunks(png):
    """Return the chunks of a PNG file by name, after comparing each one's checksum."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    found, place = {}, 8
    while place < len(png):
        length, name = unpack(">I4s", png[place : place + 8])
        data = png[place + 8 : place + 8 + length]
        assert unpack(">I", png[place + 8 + length : place + 12 + length])[0] == zlib.crc32(name + data)
        found[name], place = data, place + 12 + length
    return found


def _sound(wav):
    with wave.open(io.BytesIO(wav)) as sound:
        return sound.readframes(sound.getnframes())


def _pixels(png):
    chunks = _chunks(png)
    width, height = unpack(">II", chunks[b"IHDR"][:8])
    lines = zlib.decompress(chunks[b"IDAT"])
    assert len(lines) == height * (width + 1)
    return b"".join(lines[start + 1 : start + width + 1] for start in range(0, len(lines), width + 1))


@pytest.mark.parametrize(
    ("media_type", "read"),
    [
        ("image/png", _pixels),
        ("image/bmp", lambda bmp: bmp[unpack("<I", bmp[10:14])[0] :]),
        ("audio/wav", _sound),
        ("application/gzip", gzip.decompress),
        ("application/zip", lambda archive: zipfile.ZipFile(io.BytesIO(archive)).read("roaas.bin")),
        ("image/svg+xml", lambda svg: bytes.fromhex(svg.decode().partition("<!--")[2].partition("-->")[0])),
        ("image/jpeg", lambda jpeg: jpeg[24 : 22 + unpack(">H", jpeg[22:24])[0]]),
        ("application/octet-stream", bytes),
    ],
)
def test_what_a_file_is_made_of_is_read_from_it(media_type, read):
    assert read(file_of(media_type, _OCTETS)) == _OCTETS


def test_a_pdf_has_its_table_where_it_says():
    pdf = file_of("application/pdf", _OCTETS)
    table = int(pdf.split()[-2])
    places = [int(line[:10]) for line in pdf[table:].splitlines() if line.endswith(b" n ")]
    assert [pdf[place : place + 7] for place in places] == [b"%d 0 obj" % number for number in (1, 2, 3, 4)]


def test_a_type_that_cannot_be_made_is_a_file_all_the_same():
    assert (is_made("image/tiff"), keeps_octets("image/tiff"), keeps_octets("text/csv")) == (False, True, False)
