"""Checks an MCAP file against the specification (mcap.dev/spec), independently of our writer: structure, every
checksum, every index. Chunks have to be uncompressed. Prints one JSON line a message, then a summary. Standard library
only.
    python3 mcap_reader.py FILE.mcap
"""
import json, struct, sys, zlib

MAGIC = b"\x89MCAP0\r\n"

class Reader:
    def __init__(self, data):
        self.data, self.at = data, 0
    def take(self, count):
        assert self.at + count <= len(self.data), "cut short"
        self.at += count
        return self.data[self.at - count:self.at]
    def number(self, code):
        return struct.unpack("<" + code, self.take(struct.calcsize("<" + code)))[0]
    def text(self):
        return self.take(self.number("I")).decode("utf-8")
    def list(self, codes):
        inner, result = Reader(self.take(self.number("I"))), []
        while inner.at < len(inner.data):
            result.append(tuple(inner.number(c) for c in codes))
        return result
    def end(self):
        assert self.at == len(self.data), "bytes left over in a record"

def records(data, begin, end):
    at = begin
    while at < end:
        length = struct.unpack_from("<Q", data, at + 1)[0]
        assert at + 9 + length <= end, "a record runs over its section"
        yield at, data[at], data[at + 9:at + 9 + length]
        at += 9 + length
    assert at == end

def read_schema(body):
    r = Reader(body)
    number, name, encoding = r.number("H"), r.text(), r.text()
    schema = json.loads(r.take(r.number("I")))
    r.end()
    assert number and encoding == "jsonschema" and schema["title"] == name
    return number, (name, schema)

def read_channel(body):
    r = Reader(body)
    result = r.number("H"), (r.number("H"), r.text(), r.text())
    r.list("II")
    r.end()
    return result

def check(value, schema, where):
    """As much of JSON Schema as our schemas use."""
    kinds = {"object": dict, "array": list, "string": str, "boolean": bool, "integer": int, "number": (int, float)}
    kind = schema.get("type")
    assert kind is None or isinstance(value, kinds[kind]), "%s is no %s" % (where, kind)
    if kind == "object":
        for key, inner in value.items():
            if key in schema["properties"]:
                check(inner, schema["properties"][key], where + "." + key)
            else:
                assert where.startswith("rtsg"), where + " has no " + key
    if kind == "array":
        for inner in value:
            check(inner, schema["items"], where + "[]")

def main(path):
    data = open(path, "rb").read()
    assert data[:8] == MAGIC and data[-8:] == MAGIC, "magic"
    footer_at = len(data) - 8 - 9 - 20
    assert data[footer_at] == 2
    footer = Reader(data[footer_at + 9:-8])
    summary, offsets, crc = footer.number("Q"), footer.number("Q"), footer.number("I")
    assert zlib.crc32(data[summary:footer_at + 9 + 16]) == crc, "summary checksum"

    schemas, channels, chunks, messages, counts = {}, {}, [], [], {}
    section = list(records(data, 8, summary))
    assert section[0][1] == 1 and section[-1][1] == 15
    end_at, _, body = section[-1]
    assert zlib.crc32(data[:end_at]) == Reader(body).number("I"), "data checksum"
    for at, op, body in section[1:-1]:
        r = Reader(body)
        if op == 3:
            number, schema = read_schema(body)
            schemas[number] = schema
        elif op == 4:
            number, channel = read_channel(body)
            assert channel[0] in schemas and channel[2] == "json"
            channels[number] = channel
            counts[number] = 0
        elif op == 6:
            start, end, size, crc = r.number("Q"), r.number("Q"), r.number("Q"), r.number("I")
            assert r.text() == "", "compressed"
            content = r.take(r.number("Q"))
            r.end()
            assert len(content) == size and zlib.crc32(content) == crc, "chunk checksum"
            chunk = {"at": at, "length": 9 + len(body), "start": start, "end": end, "size": size, "index": {},
                     "found": {}}
            times = []
            for offset, inner_op, inner in records(content, 0, len(content)):
                assert inner_op == 5
                m = Reader(inner)
                number, sequence, log_time, publish_time = m.number("H"), m.number("I"), m.number("Q"), m.number("Q")
                assert sequence == counts[number], "sequence"
                counts[number] += 1
                text = m.take(len(inner) - m.at)
                value = json.loads(text)
                check(value, schemas[channels[number][0]][1], schemas[channels[number][0]][0])
                messages.append((log_time, channels[number][1], value))
                chunk["found"].setdefault(number, []).append((log_time, offset))
                times.append(log_time)
            assert (start, end) == (min(times), max(times)), "chunk times"
            chunks.append(chunk)
        elif op == 7:
            number = r.number("H")
            chunks[-1]["index"][number] = at
            assert r.list("QQ") == chunks[-1]["found"][number], "message index"
            chunks[-1]["index_end"] = at + 9 + len(body)
        else:
            assert False, "record %d in the data section" % op

    groups, chunk_index, statistics = [], [], None
    for at, op, body in records(data, summary, offsets):
        if not groups or groups[-1][0] != op:
            groups.append([op, at, 0])
        groups[-1][2] += 9 + len(body)
        r = Reader(body)
        if op == 3:
            number, schema = read_schema(body)
            assert schemas[number] == schema
        elif op == 4:
            number, channel = read_channel(body)
            assert channels[number] == channel
        elif op == 8:
            start, end, chunk_at, length = (r.number("Q") for _ in range(4))
            index, index_length = dict(r.list("HQ")), r.number("Q")
            compression, packed, size = r.text(), r.number("Q"), r.number("Q")
            r.end()
            chunk_index.append((start, end, chunk_at, length, index, index_length, size))
            assert compression == "" and packed == size
        elif op == 11:
            r2 = Reader(body)
            statistics = [r2.number(c) for c in "QHIIIIQQ"] + [dict(r2.list("HQ"))]
            r2.end()
        else:
            assert False, "record %d in the summary" % op
    assert len({g[0] for g in groups}) == len(groups), "summary not grouped"
    assert [tuple(g) for g in groups] == [(b[0], *struct.unpack("<QQ", b[1:]))
                                          for _, op, b in records(data, offsets, footer_at)], "offsets"
    assert chunk_index == [(c["start"], c["end"], c["at"], c["length"], c["index"],
                            c["index_end"] - c["at"] - c["length"], c["size"]) for c in chunks], "chunk index"
    times = [m[0] for m in messages]
    assert statistics == [len(messages), len(schemas), len(channels), 0, 0, len(chunks), min(times), max(times), counts]
    for time, topic, value in messages:
        print(json.dumps({"time": time, "topic": topic, "message": value}))
    print(json.dumps({"messages": len(messages), "chunks": len(chunks),
                      "topics": {c[1]: {"schema": schemas[c[0]][0], "messages": counts[n]}
                                 for n, c in channels.items()}}))

main(sys.argv[1])
