#!/usr/bin/env python3
"""Reads a log by PROTOCOL.md alone: Python 3, standard library only. Prints one JSON object a line: the head, every
record, what bytes are damaged, and at the end a summary with the last value of every field of every node.
usage: reader.py LOG [--values]"""
import json, os, struct, sys, zlib
import packed_arrays, prediction

M64 = (1 << 64) - 1
SECRET = bytes.fromhex(
    "b8fe6c3923a44bbe7c01812cf721ad1cded46de9839097db7240a4a4b7b3671fcb79e64eccc0e578825ad07dccff7221b8084674f743248ee0"
    "3590e6813a264c3c2852bb91c300cb88d0658b1b532ea371644897a20df94e3819ef46a9deacd8a8fa763fe39c343ff9dcbbc7c70b4f1d8a51"
    "e04bcdb45931c89f7ec9d9787364eac5ac8334d3ebc3c581a0fffa1363eb170ddd51b7f0da49d316552629d4689e2b16be587d47a1fc8ff8b8"
    "d17ad031ce45cb3a8f95160428afd7fbcabb4b407e")
P32 = (0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D)
P64 = (0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0x85EBCA77C2B2AE63, 0x27D4EB2F165667C5)

def fold(a, b):
    product = a * b
    return (product ^ product >> 64) & M64

def avalanche(h):
    h = ((h & M64) ^ (h & M64) >> 37) * 0x165667919E3779F9 & M64
    return h ^ h >> 32

u64 = lambda data, at: int.from_bytes(data[at:at + 8], "little")
mix16 = lambda data, at, k: fold(u64(data, at) ^ u64(SECRET, k), u64(data, at + 8) ^ u64(SECRET, k + 8))

def xxh3(data):
    """XXH3-64, seed 0, of 17 bytes or more (a record's checksummed part has at least 48)."""
    n = len(data)
    if n <= 128:
        acc = n * P64[0]
        for i in range((n - 1) // 32 + 1):
            acc += mix16(data, 16 * i, 32 * i) + mix16(data, n - 16 * (i + 1), 32 * i + 16)
        return avalanche(acc)
    if n <= 240:
        acc = avalanche(n * P64[0] + sum(mix16(data, 16 * i, 16 * i) for i in range(8)))
        acc += sum(mix16(data, 16 * i, 16 * (i - 8) + 3) for i in range(8, n // 16)) + mix16(data, n - 16, 136 - 17)
        return avalanche(acc)
    acc = [P32[2], P64[0], P64[1], P64[2], P64[3], P32[1], P64[4], P32[0]]
    keys = [struct.unpack_from("<8Q", SECRET, 8 * i) for i in range(17)]
    last, scramble = struct.unpack_from("<8Q", SECRET, 121), struct.unpack_from("<8Q", SECRET, 128)
    def accumulate(stripe, key):
        for i in range(8):
            mixed = stripe[i] ^ key[i]
            acc[i ^ 1] += stripe[i]
            acc[i] = (acc[i] + (mixed & 0xFFFFFFFF) * (mixed >> 32)) & M64
    stripes = (n - 1) // 64
    for k in range(stripes):
        accumulate(struct.unpack_from("<8Q", data, 64 * k), keys[k % 16])
        if k % 16 == 15:
            acc[:] = [((a & M64) ^ (a & M64) >> 47 ^ s) * P32[0] & M64 for a, s in zip(acc, scramble)]
    accumulate(struct.unpack_from("<8Q", data, n - 64), last)
    result = n * P64[0]
    for i in range(0, 8, 2):
        result += fold((acc[i] & M64) ^ u64(SECRET, 11 + 8 * i), (acc[i + 1] & M64) ^ u64(SECRET, 19 + 8 * i))
    return avalanche(result)

# Codes of struct for the SF types in order; MF types follow each.
ELEMENTS = "? i f d d String I 3f 4f Image 2f 2d 3f 3d 4f 4d 4f 9f 9d 16f 16d".split()

class Reader:
    def __init__(self, data):
        self.data, self.at = data, 0
    def take(self, count):
        if count > len(self.data) - self.at:
            raise ValueError("cut short")
        self.at += count
        return self.data[self.at - count:self.at]
    def take_struct(self, code):
        return struct.unpack("<" + code, self.take(struct.calcsize("<" + code)))
    def number(self, code):
        return self.take_struct(code)[0]
    def varint(self):
        result = shift = 0
        while True:
            byte = self.take(1)[0]
            result |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return result
    def node(self, previous, coded=None):
        coded = self.varint() if coded is None else coded
        return previous + (coded >> 1 ^ -(coded & 1))
    def text(self):
        return self.take(self.varint()).decode("utf-8", "replace")
    def part(self):
        return Reader(self.take(self.varint()))
    def element(self, base):
        code = ELEMENTS[base]
        if code == "String":
            return self.text()
        if code == "Image":
            return list(struct.unpack("<%di" % (n := self.varint()), self.take(4 * n)))
        numbers = self.take_struct(code)
        return numbers[0] if len(code) == 1 else list(numbers)
    def value(self, kind):
        return [self.element(kind // 2) for _ in range(self.varint())] if kind % 2 else self.element(kind // 2)

def read_type(outer):
    r = outer.part()
    t = {"name": r.text(), "component": r.text(), "level": r.varint(), "kind": r.number("B"), "container": r.text(),
         "implements": r.value(11), "declaration": r.text()}
    t["fields"] = []
    for f in [r.part() for _ in range(r.varint())]:
        field = {"name": f.text(), "type": f.number("B"), "use": f.number("B"), "flags": (flags := f.number("B"))}
        for bit, name, kind in ((4, "min", 6), (8, "max", 6), (16, "allowed", 11), (32, "accepts", 11),
                                (64, "default", field["type"])):
            if flags & bit:
                field[name] = f.value(kind)
        t["fields"].append(field)
    return t

def inflated(payload, words=b""):
    """The blocks with those of kind 14 replaced by what they hold."""
    r, blocks = Reader(payload), b""
    while r.at < len(payload):
        start = r.at
        kind, _, body = r.number("B"), r.varint(), r.part()
        if kind != 14:
            blocks += payload[start:r.at]
            continue
        size = body.varint()
        held = zlib.decompressobj(-15, words).decompress(body.data[body.at:]) if words else zlib.decompress(body.data[body.at:], -15)
        if len(held) != size:
            raise ValueError("a deflated block of another size")
        blocks += held
    return blocks

def read_changes(payload, types, state, memory, words=b""):
    """Applies a frame's blocks to state = {"nodes": {id: type index}, "values": {(node, field): value}, ...}."""
    r, counts = Reader(payload := inflated(payload, words)), {}
    nodes, values, names, routes = state.values()
    while r.at < len(payload):
        kind, count = r.number("B"), r.varint()
        b, node, other = r.part(), 0, 0
        counts[kind] = counts.get(kind, 0) + count
        if kind == 4:  # values, a column
            coding, flags, kind_of_value, field = b.number("B"), b.number("B"), b.number("B"), b.varint()
            for node in [node := b.node(node) for _ in range(count)] if coding == 0 else []:
                start, values[node, field] = b.at, b.value(kind_of_value)
                if memory and kind_of_value in prediction.LANES:
                    memory.raw(node, field, kind_of_value, b.data[start:b.at])
            for node in [node := b.node(node) for _ in range(count)] if coding == 3 else []:
                values[node, field] = packed_arrays.value(b, kind_of_value)
            if coding in (1, 2):
                values.update({(n, field): v for n, v in memory.column(b, count, coding, kind_of_value, field)})
                counts["predicted"] = counts.get("predicted", 0) + count
        for _ in range(count if kind in (0, 1, 2, 3, 5, 6, 7, 8) else 0):
            if kind == 0:  # built-in types at their first use
                number = b.varint()
                types[number] = read_type(b)
                if types[number]["name"] == "RtsgScene":
                    nodes[1] = number
            elif kind == 1:  # types of the scene's own
                types.setdefault(b.varint() >> 1, read_type(b))
            elif kind == 2:  # nodes created
                node = b.node(node, b.varint() >> 1)
                nodes[node], other = b.varint(), b.node(other)
            elif kind == 3:  # links
                tag, node, field = b.number("B"), b.node(node), b.varint()
                if tag & 3 == 0:
                    values[node, field] = b.node(node)
                elif tag & 3 == 1:
                    child = node
                    values[node, field] = [child := b.node(child) for _ in range(b.varint())]
                else:
                    child, index = b.node(node), b.varint()
                    children = values[node, field] = list(values.get((node, field), []))
                    children.insert(index, child) if tag & 3 == 2 else children.pop(index)
            elif kind == 5:  # names
                node = b.node(node, b.varint() >> 1)
                names[node] = b.text()
            elif kind == 6:  # routes
                tag, node = b.number("B"), b.node(node)
                route = (node, b.varint(), b.node(node), b.varint(), bool(tag & 4))
                routes.discard(route) if tag & 1 else routes.add(route)
            elif kind == 7:  # nodes destroyed
                node = b.node(node, b.varint() >> 1)
                nodes.pop(node, None), names.pop(node, None)
                for key in [k for k in values if k[0] == node]:
                    del values[key]
            elif kind == 8:  # events
                node = b.node(node, b.varint() >> 1)
                b.varint(), b.value(b.number("B"))
    return counts

def of_protocol(name):
    return open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../sync", name), "rb").read()

def catalogue():
    r, types = Reader(of_protocol("catalogue.bin")), []
    while r.at < len(r.data):
        types.append(read_type(r))
    return types

fresh = lambda: {"nodes": {1: 0}, "values": {}, "names": {}, "routes": set()}

def main(path, show_values):
    data = open(path, "rb").read()
    at, state, at_state, at_epoch, types, frames, damaged = 0, fresh(), None, None, {}, 0, None
    memory = prediction.Memory()
    while at < len(data):
        head = data[at:at + 64]
        length = int.from_bytes(head[18:24], "little")
        whole = len(head) == 64 and head[:8] == b"RTSGrec1" and at + 64 + length <= len(data)
        if not whole or xxh3(data[at + 16:at + 64 + length]) != u64(head, 8):
            damaged = at if damaged is None else damaged
            at = data.find(b"RTSGrec1", at + 1) % (len(data) + 1)
            continue
        if damaged is not None:
            print(json.dumps({"damage": damaged, "length": at - damaged}))
            damaged = None
        kind, origin, to = head[16], u64(head, 24), u64(head, 32)
        payload, time = data[at + 64:at + 64 + length], struct.unpack_from("<d", head, 40)[0]
        if kind == 1:
            r = Reader(payload)
            version, _, epoch, _, builtin, mode, coding, error = r.take_struct("HHQQHBBd")
            if epoch != at_epoch:  # else a repetition
                types, at_state, at_epoch = {}, None, epoch
                print(json.dumps({"head": version, "epoch": epoch, "creator": r.text(), "types": builtin,
                                  "mode": ("state", "input", "lossy")[mode], "error": error}))
        elif kind == 7:
            version, builtin, root = struct.unpack_from("<HHH", payload)
            if version != 1:
                raise ValueError("a scene of version %d" % version)
            state, types, at_state = fresh(), dict(enumerate(catalogue()[:builtin])), to
            state["nodes"][1] = root
            blocks = read_changes(payload[6:], types, state, None, of_protocol("words.bin"))
            frames += 1
            print(json.dumps({"state": to, "scene": builtin, "t": time, "hash": head[48:64][::-1].hex(), "blocks": blocks}))
        elif kind in (2, 3) and head[17] < 8 and (
                origin == at_state or (kind == 3 and (at_state is None or to > at_state))):
            if origin != at_state:
                state = fresh()
            memory.begin(head[17] if kind == 2 else 4)
            blocks = read_changes(payload, types, state, memory if kind == 2 and head[17] & 1 else None)
            at_state, frames = to, frames + 1
            print(json.dumps({"state": to, "from": origin, "t": time, "hash": head[48:64][::-1].hex(),
                              "blocks": blocks}))
        elif kind == 2 and origin != at_state:
            at_state = None  # frames are missing: wait for a keyframe
        at += 64 + length
    if damaged is not None:
        print(json.dumps({"damage": damaged, "length": len(data) - damaged}))
    summary = {"frames": frames, "nodes": len(state["nodes"]), "routes": len(state["routes"]), "state": at_state}
    if show_values:
        field = lambda n, f: types[state["nodes"][n]]["fields"][f]["name"]
        summary["values"] = {"%s.%s" % (state["names"].get(n) or "#%d" % n, field(n, f)): v
                             for (n, f), v in sorted(state["values"].items())}
    print(json.dumps(summary))

main(sys.argv[1], "--values" in sys.argv)
