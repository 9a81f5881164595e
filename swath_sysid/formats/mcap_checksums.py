"""Checksums of mcap files (mcap.dev/spec), and recovery of what is intact in a damaged one.

A file is a magic, records (code, length of eight bytes, content) and the magic again. Chunks, the data section and
the summary have a checksum each; zero means none.
"""

import os
import struct
from binascii import crc32
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

from swath_sysid.formats.files import BLOCK_BYTES
from swath_sysid.formats.registry import BAGS

MAGIC = BAGS['.mcap']
HEADER, FOOTER, MESSAGE, CHUNK, CHUNK_INDEX, DATA_END = b'\x01', b'\x02', b'\x05', b'\x06', b'\x08', b'\x0f'
ROS2 = b'\x04\0\0\0ros2\0\0\0\0'  #: The content of the header of a bag: profile and library.
HEAD = struct.Struct('<cQ')
FOOTER_BYTES = HEAD.size + 20 + len(MAGIC)
#: Of a file without an index.
ENDING = HEAD.pack(DATA_END, 4) + bytes(4) + HEAD.pack(FOOTER, 20) + bytes(20) + MAGIC
CHUNK_BEGIN = struct.Struct('<QQQ')  #: First and last time and uncompressed size of a chunk; its checksum follows.


def _records(file: BinaryIO) -> Iterator[tuple[bytes, int, int]]:
    """Code, place and length of the content of one record after the other, to the footer; the file may be moved in."""
    at, code = len(MAGIC), None
    file.seek(at)
    while code != FOOTER and len(head := file.read(HEAD.size)) == HEAD.size:
        code, length = HEAD.unpack(head)
        at += HEAD.size
        yield code, at, length
        at += length
        file.seek(at)


def _number(file: BinaryIO, at: int, size: int = 4) -> int:
    file.seek(at)
    return int.from_bytes(file.read(size), 'little')


def damage_of(path: Path) -> str:
    """What is wrong with the record lengths, the index or the checksums of data section and summary; empty: nothing is.
    Lengths come first, because a corrupt one would have as much memory allocated. Chunks are checked when read.
    """
    with open(path, 'rb') as file:
        size = file.seek(0, os.SEEK_END)
        records = list(_records(file))
        if size < len(MAGIC) + FOOTER_BYTES or not records or sum(records[-1][1:]) + len(MAGIC) != size:
            return 'a record in it goes beyond its end'
        codes = Counter(code for code, _, _ in records)
        if (listed := codes[CHUNK_INDEX]) and (listed < codes[CHUNK] or codes[MESSAGE]):
            return 'its index leaves out messages'
        summary_start = _number(file, size - FOOTER_BYTES + HEAD.size, 8)
        summary_end = size - len(MAGIC) - 4
        summary_sum = _number(file, summary_end)
        if summary_sum and summary_start and _sum_of(file, summary_start, summary_end) != summary_sum:
            return 'the check sum of its summary does not hold'
        for code, at, _ in records:
            if code == DATA_END and (data_sum := _number(file, at)) and _sum_of(file, 0, at - HEAD.size) != data_sum:
                return 'the check sum of its data does not hold'
    return ''


def is_ros2(path: Path) -> bool:
    """Whether the header of an mcap file names the profile of ROS 2, as its library demands."""
    with open(path, 'rb') as file:
        return file.read(len(MAGIC) + HEAD.size + 8).endswith(ROS2[:8])


def add_checksums(path: Path) -> None:
    """Write the check sums into a whole mcap file that has none: a flipped byte is not to pass for a measurement."""
    with open(path, 'rb+') as file:

        def write(at: int, total: int) -> None:
            file.seek(at)
            file.write(total.to_bytes(4, 'little'))

        for code, at, length in _records(file):
            if code == CHUNK:
                write(at + CHUNK_BEGIN.size, crc32(_unpacked(file.read(length))))
            elif code == DATA_END:
                write(at, _sum_of(file, 0, at - HEAD.size))
        end = file.seek(0, os.SEEK_END) - len(MAGIC) - 4
        if summary_start := _number(file, end + 4 + len(MAGIC) - FOOTER_BYTES + HEAD.size, 8):
            write(end, _sum_of(file, summary_start, end))


def cut_off(path: Path, size: int) -> None:
    """Make a whole file, without an index, of the first bytes of one that cannot grow."""
    os.truncate(path, size)
    with open(path, 'ab') as file:
        file.write(ENDING)
        file.flush()
        os.fsync(file.fileno())
    add_checksums(path)


def copy_whole_records(path: Path, target: Path) -> None:
    """Copy an mcap file up to its last complete record, without chunks whose checksum fails and without an index. Of a
    plain chunk that was cut off, its complete records are kept. The header names the profile of ROS 2.
    """
    size = path.stat().st_size
    with open(path, 'rb') as source, open(target, 'wb') as copy:
        copy.write(MAGIC)
        source.seek(len(MAGIC))
        while len(head := source.read(HEAD.size)) == HEAD.size and head[:1] not in (FOOTER, DATA_END):
            length = HEAD.unpack(head)[1]
            if source.tell() + length <= size:
                content = source.read(length)
                if head[:1] == HEADER:
                    head, content = HEAD.pack(HEADER, len(ROS2)), ROS2
                if head[:1] != CHUNK or _chunk_holds(content):
                    copy.write(head + content)
                continue
            if head[:1] != CHUNK or _number(source, source.tell() + CHUNK_BEGIN.size + 4):
                break
            source.seek(8, os.SEEK_CUR)
        copy.write(ENDING)


def _chunk_holds(content: bytes) -> bool:
    """Whether the check sum of a chunk holds, or it has none."""
    expected = int.from_bytes(content[CHUNK_BEGIN.size : CHUNK_BEGIN.size + 4], 'little')
    try:
        return not expected or crc32(_unpacked(content)) == expected
    except Exception:  # noqa: BLE001 - the libraries raise whatever a broken byte leads them to
        return False


def _unpacked(content: bytes) -> bytes:
    """The records in a chunk."""
    at = CHUNK_BEGIN.size + 8
    end = at + int.from_bytes(content[at - 4 : at], 'little')
    compression, size = content[at:end].decode(), int.from_bytes(content[end : end + 8], 'little')
    return DECOMPRESSORS[compression](content[end + 8 : end + 8 + size], CHUNK_BEGIN.unpack_from(content)[-1])


def _sum_of(file: BinaryIO, start: int, end: int) -> int:
    """CRC-32 of a part of a file."""
    file.seek(start)
    total, left = 0, end - start
    while left > 0 and (block := file.read(min(BLOCK_BYTES, left))):
        total = crc32(block, total)
        left -= len(block)
    return total
