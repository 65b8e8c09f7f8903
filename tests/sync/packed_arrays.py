"""Columns of packed arrays, by PROTOCOL.md ("Arrays") alone; used by reader.py. Standard library only."""
import struct

import prediction

LANES = {3: 1, 5: 1, 21: 2, 25: 3, 15: 3, 29: 4, 17: 4, 33: 4}  # value type: 32-bit numbers of an element
MFINT32, BLOCK = 3, 1024

def lane(r, size, is_float):
    form, lag, base = r.take_struct("BBI")
    bits, decimal = form & 127, form & 128
    if bits > 32 or not 1 <= lag <= 8 or (decimal and not is_float):
        raise ValueError("unknown packing")
    exponent, odd = r.take_struct("BB") if decimal else (0, 0)
    if exponent > 10 or odd > 32:
        raise ValueError("unknown packing")
    odds = [r.take_struct("HI") for _ in range(odd)]
    numbers = [r.number("I") for _ in range(min(lag, size))]
    count = size - len(numbers)
    word = int.from_bytes(r.take((count * bits + 7) // 8), "little")
    for _ in range(count):
        numbers.append(numbers[-lag] + base + (word & (1 << bits) - 1) & prediction.MASK)
        word >>= bits
    numbers = [prediction.signed(n) for n in numbers]
    if not is_float:
        return numbers
    if not decimal:
        return [prediction.to_float(n) for n in numbers]
    floats = [struct.unpack("<f", struct.pack("<f", n / 10 ** exponent))[0] for n in numbers]
    for at, value in odds:
        floats[at] = struct.unpack("<f", struct.pack("<I", value))[0]
    return floats

def value(r, kind):
    if kind not in LANES:
        raise ValueError("a type that is not packed")
    size, lanes, result = r.varint(), LANES[kind], []
    if -(-size // BLOCK) * lanes * 10 > len(r.data) - r.at:
        raise ValueError("count exceeds the bytes that follow")
    for first in range(0, size, BLOCK):
        columns = [lane(r, min(BLOCK, size - first), kind != MFINT32) for _ in range(lanes)]
        result += columns[0] if lanes == 1 else [list(row) for row in zip(*columns)]
    return result
