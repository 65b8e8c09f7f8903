"""Writes the records of a log as seeds of a fuzz target: LOG, FOLDER, kinds of records to take (2 frame, 3 keyframe, 5 input), how many
bytes at most. A frame's payload alone as well: the target puts a header and a checksum before it."""
import pathlib
import struct
import sys

log, folder, kinds, most = sys.argv[1], pathlib.Path(sys.argv[2]), set(map(int, sys.argv[3].split(","))), int(sys.argv[4])
folder.mkdir(parents=True, exist_ok=True)
data = pathlib.Path(log).read_bytes()
at, taken = 0, {}
while at < len(data):
    kind = data[at + 16]
    length = struct.unpack_from("<Q", data, at + 16)[0] >> 16
    record = data[at:at + 64 + length]
    at += 64 + length
    if kind not in kinds or len(record) > most or taken.get(kind, 0) >= 4 or length == 0:
        continue
    taken[kind] = taken.get(kind, 0) + 1
    name = f"{pathlib.Path(log).stem}_{kind}_{taken[kind]}"
    (folder / name).write_bytes(record[64:])
    if kind != 5:
        (folder / (name + "_whole")).write_bytes(record)
