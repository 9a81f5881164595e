"""What a bag holds, read by rosbags alone, and damage to one."""

from swath_sysid.formats.bags import opened_bag
from swath_sysid.formats.messages import typestore

STORE = typestore()


def messages_of(path):
    """Topic, type, time and bytes of every message of a bag."""
    with opened_bag(path) as (readers, advice):
        assert advice == []
        return [
            (c.topic, c.msgtype, time, bytes(raw))
            for reader in readers
            for c, time, raw in reader.messages(reader.connections)
        ]


def decoded(path, topic):
    return [(time, STORE.deserialize_cdr(raw, kind)) for name, kind, time, raw in messages_of(path) if name == topic]


def stamp_of(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def break_a_chunk(folder):
    """Zeros in the middle of the only file of a bag."""
    file = folder / f'{folder.name}.mcap'
    broken = bytearray(file.read_bytes())
    middle = len(broken) // 2
    broken[middle : middle + 4096] = bytes(4096)
    file.write_bytes(broken)
