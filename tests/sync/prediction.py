"""Predicted columns, by PROTOCOL.md ("Prediction") alone; used by reader.py. Standard library only."""
import math, struct

LANES = {4: 1, 20: 2, 24: 3, 14: 3, 28: 4, 16: 4, 32: 4}  # value type: f32 components
ROTATION, UNKNOWN, MASK = 32, 33, 0xFFFFFFFF
CLASSES = [1, 2, 3, 4, 4] + [5] * 2 + [6] * 3 + [7] * 4 + [8] * 6 + [9] * 13 + [0]
RATES = [1, 2, 3, 3, 4, 4, 4, 4, 4, 4, 5, 5, 5, 5, 5, 5]

signed = lambda n: (n & MASK) - ((n & 0x80000000) << 1)
number_of_bits = lambda bits: signed(bits ^ 0x7FFFFFFF if bits >> 31 else bits)
bits_of_number = lambda n: (n ^ 0x7FFFFFFF if n < 0 else n) & MASK
to_float = lambda n: struct.unpack("<f", struct.pack("<I", bits_of_number(n)))[0]
of_float = lambda x: number_of_bits(struct.unpack("<I", struct.pack("<f", x))[0])

def to_grid(kind, numbers, width):
    floats = [to_float(n) for n in numbers]
    if kind == ROTATION:
        floats = [x * floats[3] for x in floats[:3]]
    points = [x / width for x in floats]
    return [round(p) if abs(p) < 2 ** 21 and abs(round(p)) < 2 ** 21 else 0 for p in points]

def from_grid(kind, grid, width):
    r = [n * width for n in grid]
    if kind == ROTATION:
        angle = math.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
        r = [x / angle for x in r] + [angle] if angle > 0 else [0, 0, 1, 0]
    return [of_float(x) for x in r]

class Bits:
    def __init__(self, data):
        self.word, self.left = int.from_bytes(data, "little"), 8 * len(data)
    def get(self, count):
        result, self.word, self.left = self.word & (1 << count) - 1, self.word >> count, self.left - count
        if self.left < 0:
            raise ValueError("residuals cut short")
        return result
    def packed(self, size):
        width = 12 if size == UNKNOWN else size + 1 if size else 0
        while width < 32 and self.get(1):
            width += 3
        z = self.get(min(width, 32))
        return z >> 1 ^ -(z & 1)

class Range:
    def __init__(self, data):
        self.data, self.at, self.code, self.range = data, 4, int.from_bytes((data + bytes(4))[:4], "big"), MASK
    def decide(self, models, key):
        zero, seen = models.get(key, (1 << 14, 0))
        bound, rate = (self.range >> 15) * zero, RATES[seen]
        bit = self.code >= bound
        if bit:
            self.code, self.range, zero = self.code - bound, self.range - bound, zero - (zero >> rate)
        else:
            self.range, zero = bound, zero + (32768 - zero >> rate)
        models[key] = zero, min(seen + 1, 15)
        while self.range < 1 << 24:
            byte = self.data[self.at] if self.at < len(self.data) else 0
            self.code, self.range, self.at = self.code << 8 | byte, self.range << 8, self.at + 1
        return int(bit)
    def number(self, bits, models, model, size):
        c, t = CLASSES[size], 1
        if not self.decide(models, ("zero", model, c)):
            return 0
        for _ in range(5):
            t = t << 1 | self.decide(models, ("size", model, c, t))
        n, negative, m = (t & 31) + 1, self.decide(models, ("sign", model, c)), 1
        if n >= 2:
            m = 2 | self.decide(models, ("top", model, n))
        if n >= 3:
            m = m << n - 2 | bits.get(n - 2)
        return -m if negative else m

class Field:
    """Of one node: up to three values as numbers, newest first."""
    def __init__(self, numbers):
        self.past, self.grid, self.depth, self.sync = [numbers], 0, 1, -1
        self.orders, self.sizes = [0] * 4, [UNKNOWN] * 4
    def bring(self, kind, width):
        if self.grid != width:
            if self.grid:
                self.past = [from_grid(kind, p, self.grid) for p in self.past]
            if width:
                self.past = [to_grid(kind, p, width) for p in self.past]
            self.grid = width
    def forecasts(self, lane):
        p = [v[lane] for v in self.past[:self.depth]]
        result = [p[0]]
        x = p if self.grid else [to_float(n) for n in p]
        for extrapolated in ([2 * x[0] - x[1]] if len(x) > 1 else []) + (
                [3 * (x[0] - x[1]) + x[2]] if len(x) > 2 else []):
            if self.grid:
                result.append(signed(extrapolated))
            else:
                result.append(of_float(extrapolated) if abs(extrapolated) <= 3.4028234663852886e38 else p[0])
        return result
    def code(self, kind, residual):
        """`residual(lane, size)` gives or makes them; returns the new numbers and learns from them."""
        lanes = 3 if kind == ROTATION and self.grid else LANES[kind]
        forecasts, last = [self.forecasts(l) for l in range(lanes)], None
        now, sizes = [0] * lanes, [UNKNOWN] * 4
        if kind == ROTATION and not self.grid:
            x, y, z = axis = [to_float(n) for n in self.past[0][:3]]
            if abs(x * x + y * y + z * z - 1) < 1e-5:
                last = max(range(3), key=lambda l: abs(axis[l]))
        for l in [l for l in range(lanes) if l != last] + ([] if last is None else [last]):
            foretold = forecasts[l][min(self.orders[l], self.depth - 1)]
            if l == last:
                p, q = (to_float(now[k]) for k in range(3) if k != l)
                square = 1 - p * p - q * q
                size = math.sqrt(square) if square > 0 else 0.0
                foretold = of_float(-size if axis[l] < 0 else size)
            r = residual(l, foretold)
            now[l], sizes[l] = signed(foretold + r), abs(r).bit_length()
        self.orders = [0] * 4
        for l in range(lanes):
            miss = [abs(signed(now[l] - f)) for f in forecasts[l]]
            self.orders[l] = miss.index(min(miss)) if self.depth > 1 else 1
        self.sizes, self.past = sizes, [now] + self.past[:2]
        self.depth = min(self.depth + 1, 3)
        return now

class Memory:
    def __init__(self):
        self.fields, self.models, self.syncs, self.before = {}, {}, 0, []
    def begin(self, flags):
        if flags & 4:
            self.fields = {}
        if flags & 6:
            self.syncs, self.models = self.syncs + 1, {}
    def field(self, key):
        field = self.fields[key]
        if field.sync != self.syncs:
            field.depth, field.sizes = 1, [UNKNOWN] * 4
            field.sync = self.syncs
        return field
    def raw(self, node, field, kind, data):
        numbers, key = [number_of_bits(b) for b in struct.unpack("<%dI" % LANES[kind], data)], (node, field, kind)
        if key not in self.fields:
            self.fields[key] = Field(numbers)
            self.fields[key].sync = self.syncs
            return
        known = self.field(key)
        known.bring(kind, 0)
        known.code(kind, lambda l, foretold: signed(numbers[l] - foretold))
    def column(self, b, count, coding, kind, field):
        """`b`: a Reader behind the column's head. Yields (node, value)."""
        form = b.number("B")
        width = b.number("d") if form & 1 else 0
        if form >> 1 == 0:
            node, nodes = 0, []
            for _ in range(count):
                nodes.append(node := b.node(node))
        elif form >> 1 == 1:
            nodes = [0]
            for _ in range(b.varint()):
                first, more = b.node(nodes[-1]), b.varint()
                step = b.node(0) if more else 0
                nodes += [first + k * step for k in range(more + 1)]
            nodes = nodes[1:]
        else:
            nodes = self.before if form >> 1 == 2 else []
        coder = Range(b.take(b.varint())) if coding == 2 else None
        bits, size, node = Bits(b.take(len(b.data) - b.at)), UNKNOWN, 0
        models = self.models.setdefault((field, kind, bool(width)), {})
        for i in range(count):
            if form >> 1 == 3:
                gap = coder.number(bits, models, 4, size)
                node, size = node + gap, abs(gap).bit_length()
                nodes.append(node)
            known = self.field((nodes[i], field, kind))
            known.bring(kind, width)
            if coder:
                now = known.code(kind, lambda l, _: coder.number(bits, models, l, known.sizes[l]))
            else:
                now = known.code(kind, lambda l, _: bits.packed(known.sizes[l]))
            value = [to_float(n) for n in (from_grid(kind, now, width) if width else now)]
            yield nodes[i], value if len(value) > 1 else value[0]
        self.before = nodes
