"""Check sums of mcap files (mcap.dev/spec): of chunks, of the data section, and of the summary; zero is none."""
import os
import struct
from binascii import crc32

from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

MAGIC = b'\x89MCAP0\r\n'
FOOTER, CHUNK, DATA_END = 0x02, 0x06, 0x0F
HEAD = struct.Struct('<BQ')
"""Operation code and length of a record."""

FOOTER_BYTES = HEAD.size + 20 + len(MAGIC)
CHUNK_CHECKSUM_AT = 24
"""Behind its times and its uncompressed size."""

BLOCK_BYTES = 1 << 20


def damage_of(path):
    """Whether records go beyond the file, and which check sums of the data section and of the summary do not hold.

    Check sums of the chunks are looked at where the chunks are read. Lengths come first: who believes a broken one
    asks for as much memory.

    Parameters
    ----------
    path : Path
        Of a whole mcap file.

    Returns
    -------
    str
        Empty where nothing is wrong.
    """
    with open(path, 'rb') as file:
        size = file.seek(0, os.SEEK_END)
        if size < len(MAGIC) + FOOTER_BYTES or not _records_fit(file, size):
            return 'a record in it goes beyond its end'
        file.seek(size - FOOTER_BYTES)
        footer = file.read(FOOTER_BYTES)
        summary_start, _, summary_sum = struct.unpack_from('<QQI', footer, HEAD.size)
        if summary_sum and summary_start:
            if _sum_of(file, summary_start, size - len(MAGIC) - 4) != summary_sum:
                return 'the check sum of its summary does not hold'
        at, data_sum = data_end(file, size)
        if data_sum and _sum_of(file, 0, at) != data_sum:
            return 'the check sum of its data does not hold'
    return ''


def data_end(file, size):
    """Where the record stands that ends the data section, and the check sum in it (0: none)."""
    at = len(MAGIC)
    while at + HEAD.size <= size:
        file.seek(at)
        code, length = HEAD.unpack(file.read(HEAD.size))
        if code == DATA_END:
            return at, int.from_bytes(file.read(4), 'little')
        if code == FOOTER:
            break
        at += HEAD.size + length
    return at, 0


def _records_fit(file, size):
    """Whether the records fill the file from its magic to its footer."""
    at = len(MAGIC)
    while at + HEAD.size <= size:
        file.seek(at)
        code, length = HEAD.unpack(file.read(HEAD.size))
        at += HEAD.size + length
        if code == FOOTER:
            break
    return at + len(MAGIC) == size


def chunk_holds(content):
    """Whether the check sum of a chunk holds, or it has none.

    Parameters
    ----------
    content : bytes
        Of the chunk's record.
    """
    expected = int.from_bytes(content[CHUNK_CHECKSUM_AT:CHUNK_CHECKSUM_AT + 4], 'little')
    if not expected:
        return True
    try:
        return crc32(_records(content)) == expected
    except Exception:  # noqa: BLE001 - the libraries raise whatever a broken byte leads them to
        return False


def _records(content):
    """The records in a chunk, unpacked."""
    at = CHUNK_CHECKSUM_AT + 4
    name_length = int.from_bytes(content[at:at + 4], 'little')
    compression = content[at + 4:at + 4 + name_length].decode()
    at += 4 + name_length
    length = int.from_bytes(content[at:at + 8], 'little')
    return DECOMPRESSORS[compression](content[at + 8:at + 8 + length], int.from_bytes(content[16:24], 'little'))


def add_checksums(path):
    """Write the check sums into an mcap file that has none, so that a flipped byte does not pass for a measurement.

    Parameters
    ----------
    path : Path
        Of a whole mcap file with plain chunks.
    """
    with open(path, 'rb+') as file:
        size = file.seek(0, os.SEEK_END)
        at = len(MAGIC)
        while True:
            file.seek(at)
            code, length = HEAD.unpack(file.read(HEAD.size))
            if code == DATA_END:
                break
            if code == CHUNK:
                content = file.read(length)
                file.seek(at + HEAD.size + CHUNK_CHECKSUM_AT)
                file.write(crc32(_records(content)).to_bytes(4, 'little'))
            at += HEAD.size + length
        total = _sum_of(file, 0, at)
        file.seek(at + HEAD.size)
        file.write(total.to_bytes(4, 'little'))
        footer = size - FOOTER_BYTES
        file.seek(footer + HEAD.size)
        summary_start = int.from_bytes(file.read(8), 'little')
        total = _sum_of(file, summary_start, size - len(MAGIC) - 4)
        file.seek(size - len(MAGIC) - 4)
        file.write(total.to_bytes(4, 'little'))


def _sum_of(file, start, end):
    """CRC-32 of a part of a file."""
    file.seek(start)
    total, left = 0, end - start
    while left > 0 and (block := file.read(min(BLOCK_BYTES, left))):
        total = crc32(block, total)
        left -= len(block)
    return total
