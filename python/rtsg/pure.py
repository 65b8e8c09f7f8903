"""Reads logs and scene files and follows mirrors in Python alone, by sync/PROTOCOL.md and nothing else.

Logs need NumPy, mirrors pyzmq as well. `import rtsg` takes Log, follow() and what they hand out from here where the
extension module is not installed (rtsg.native is then False). Every state's hash is computed and compared. What only the
extension does raises NoExtension.
"""
import functools
import math
import os
import re
import secrets
import struct
import threading
import time
import warnings
import zlib

import numpy as np

from ._errors import Closed, DiagnosticWarning, Error, NoExtension, NoSuchField, NoSuchName, WrongThread
from ._following import Following
from ._types import Damage, Divergence, Table, Verdict


class FormatError(Error):
    """Bytes that are not as the protocol says."""

    def __init__(self, text, file=""):
        super().__init__(text, file, code="record")


# ---- XXH3 ------------------------------------------------------------------------------------------------------------

_M64, _M128 = (1 << 64) - 1, (1 << 128) - 1
_SECRET = bytes.fromhex(
    "b8fe6c3923a44bbe7c01812cf721ad1cded46de9839097db7240a4a4b7b3671fcb79e64eccc0e578825ad07dccff7221b8084674f743248ee03590e6813a264c"
    "3c2852bb91c300cb88d0658b1b532ea371644897a20df94e3819ef46a9deacd8a8fa763fe39c343ff9dcbbc7c70b4f1d8a51e04bcdb45931c89f7ec9d9787364"
    "eac5ac8334d3ebc3c581a0fffa1363eb170ddd51b7f0da49d316552629d4689e2b16be587d47a1fc8ff8b8d17ad031ce45cb3a8f95160428afd7fbcabb4b407e")
_P32 = (0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D)
_P64 = (0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0x85EBCA77C2B2AE63, 0x27D4EB2F165667C5)
_MIX = (0x165667919E3779F9, 0x9FB21C651E98DF25)
_LONG = 240  # bytes; above, NumPy sums stripes of 64
_U64 = struct.Struct("<Q").unpack_from
_U32 = struct.Struct("<I").unpack_from


def _secret(at, more=None):
    """A word of the secret, or two of them, one xor the other."""
    word = _U64(_SECRET, at)[0]
    return word if more is None else word ^ _U64(_SECRET, more)[0]


_FLIP = {n: _secret(n, n + 8) for n in (8, 16, 24, 32, 40, 48, 56, 64, 80)}
_FLIP_SHORT = tuple(_U32(_SECRET, at)[0] ^ _U32(_SECRET, at + 4)[0] for at in (0, 8))


def _fold(a, b):
    product = a * b
    return (product ^ product >> 64) & _M64


def _avalanche(h):
    h &= _M64
    h = (h ^ h >> 37) * _MIX[0] & _M64
    return h ^ h >> 32


def _avalanche64(h):
    h &= _M64
    h = (h ^ h >> 33) * _P64[1] & _M64
    h = (h ^ h >> 29) * _P64[2] & _M64
    return h ^ h >> 32


def _swap32(x):
    return int.from_bytes(x.to_bytes(4, "little"), "big")


def _swap64(x):
    return int.from_bytes(x.to_bytes(8, "little"), "big")


def _ends(data, of):
    return of(data, 0)[0], of(data, len(data) - (4 if of is _U32 else 8))[0]


def _three(data):
    """One to three bytes, each of which counts, in 32 bits."""
    n = len(data)
    return data[0] << 16 | data[n >> 1] << 24 | data[-1] | n << 8


def _mix16(data, at, key, seed=0):
    return _fold(_U64(data, at)[0] ^ (_secret(key) + seed & _M64), _U64(data, at + 8)[0] ^ (_secret(key + 8) - seed & _M64))


def _stripes(data, secret):
    """The eight sums of what has more than 240 bytes. NumPy's numbers of 64 bits wrap around, as they should."""
    def mixed(words, keys):
        x = words ^ keys
        return (x & 0xFFFFFFFF) * (x >> 32) + words[..., [1, 0, 3, 2, 5, 4, 7, 6]]

    sums = np.array([_P32[2], _P64[0], _P64[1], _P64[2], _P64[3], _P32[1], _P64[4], _P32[0]], "<u8")
    count = (len(data) - 1) // 64
    words = np.frombuffer(data, "<u8", 8 * count).reshape(count, 8)
    keys = np.stack([np.frombuffer(secret, "<u8", 8, 8 * i) for i in range(16)])
    scramble, whole = np.frombuffer(secret, "<u8", 8, 128), count // 16
    for block in mixed(words[:16 * whole].reshape(whole, 16, 8), keys).sum(axis=1, dtype="<u8"):
        sums += block
        sums = (sums ^ (sums >> 47) ^ scramble) * _P32[0]
    rest = words[16 * whole:]
    sums = sums + mixed(rest, keys[:len(rest)]).sum(axis=0, dtype="<u8")
    return [int(x) for x in sums + mixed(np.frombuffer(data[-64:], "<u8"), np.frombuffer(secret, "<u8", 8, 121))]


def _merged(sums, secret, at, start):
    return _avalanche(start + sum(_fold(sums[i] ^ _U64(secret, at + 8 * i)[0], sums[i + 1] ^ _U64(secret, at + 8 * i + 8)[0]) for i in (0, 2, 4, 6)))


def xxh3_64(data):
    """XXH3 with 64 bits and seed 0, as an int."""
    n = len(data)
    if n > _LONG:
        return _merged(_stripes(data, _SECRET), _SECRET, 11, n * _P64[0])
    if n > 128:
        sum_ = _avalanche(n * _P64[0] + sum(_mix16(data, 16 * i, 16 * i) for i in range(8)))
        return _avalanche(sum_ + sum(_mix16(data, 16 * i, 16 * (i - 8) + 3) for i in range(8, n // 16)) + _mix16(data, n - 16, 119))
    if n > 16:
        pairs = range((n - 1) // 32 + 1)
        return _avalanche(n * _P64[0] + sum(_mix16(data, 16 * i, 32 * i) + _mix16(data, n - 16 * (i + 1), 32 * i + 16) for i in pairs))
    if n > 8:
        first, last = _ends(data, _U64)
        low, high = first ^ _FLIP[24], last ^ _FLIP[40]
        return _avalanche(n + _swap64(low) + high + _fold(low, high))
    if n > 3:
        first, last = _ends(data, _U32)
        h = (last | first << 32) ^ _FLIP[8]
        h ^= (h << 49 | h >> 15) & _M64 ^ (h << 24 | h >> 40) & _M64
        h = h * _MIX[1] & _M64
        h = (h ^ (h >> 35) + n) * _MIX[1] & _M64
        return h ^ h >> 28
    return _avalanche64((_three(data) ^ _FLIP_SHORT[0]) if n else _FLIP[56])


def _mix32(low, high, data, a, b, key, seed):
    low = (low + _mix16(data, a, key, seed)) ^ (_U64(data, b)[0] + _U64(data, b + 8)[0])
    high = (high + _mix16(data, b, key + 16, seed)) ^ (_U64(data, a)[0] + _U64(data, a + 8)[0])
    return low & _M64, high & _M64


def _middle_128(data, seed):
    """Of 17 to 240 bytes."""
    n = len(data)
    low, high = n * _P64[0] & _M64, 0
    if n <= 128:
        for i in range((n - 1) // 32, -1, -1):
            low, high = _mix32(low, high, data, 16 * i, n - 16 * (i + 1), 32 * i, seed)
    else:
        for i in range(4):
            low, high = _mix32(low, high, data, 32 * i, 32 * i + 16, 32 * i, seed)
        low, high = _avalanche(low), _avalanche(high)
        for i in range(4, n // 32):
            low, high = _mix32(low, high, data, 32 * i, 32 * i + 16, 32 * i - 125, seed)
        low, high = _mix32(low, high, data, n - 16, n - 32, 103, -seed)
    mixed = low * _P64[0] + high * _P64[3] + (n - seed) * _P64[1]
    return _avalanche(low + high), -_avalanche(mixed) & _M64


def xxh3_128(data, seed=0):
    """XXH3 with 128 bits, as an int."""
    n = len(data)
    if 4 <= n <= 8:
        first, last = _ends(data, _U32)
        seed ^= _swap32(seed & 0xFFFFFFFF) << 32
        product = ((first | last << 32) ^ (_FLIP[16] + seed & _M64)) * (_P64[0] + (n << 2))
        low = product & _M64
        high = (product >> 64) + (low << 1) & _M64
        low ^= high >> 3
        low = (low ^ low >> 35) * _MIX[1] & _M64
        return low ^ low >> 28 | _avalanche(high) << 64
    if 9 <= n <= 16:
        first, last = _ends(data, _U64)
        product = (first ^ last ^ (_FLIP[32] - seed & _M64)) * _P64[0]
        last ^= _FLIP[48] + seed & _M64
        low = (product & _M64) + (n - 1 << 54) & _M64
        high = (product >> 64) + last + (last & 0xFFFFFFFF) * (_P32[1] - 1) & _M64
        product = (low ^ _swap64(high)) * _P64[1]
        return _avalanche(product) | _avalanche((product >> 64) + high * _P64[1]) << 64
    if n > _LONG:
        words = struct.unpack("<24Q", _SECRET)
        secret = struct.pack("<24Q", *[word + (-seed if i % 2 else seed) & _M64 for i, word in enumerate(words)])
        sums = _stripes(data, secret)
        low, high = _merged(sums, secret, 11, n * _P64[0]), _merged(sums, secret, 117, ~(n * _P64[1]))
    elif n > 16:
        low, high = _middle_128(data, seed)
    elif n:
        three = _three(data)
        turned = _swap32(three)
        turned = (turned << 13 | turned >> 19) & 0xFFFFFFFF
        low, high = _avalanche64(three ^ (_FLIP_SHORT[0] + seed & _M64)), _avalanche64(turned ^ (_FLIP_SHORT[1] - seed & _M64))
    else:
        low, high = _avalanche64(seed ^ _FLIP[64]), _avalanche64(seed ^ _FLIP[80])
    return low | high << 64


# ---- primitives and values -------------------------------------------------------------------------------------------

class _Reader:
    """Reads the primitives of the protocol; whatever is cut short or malformed raises FormatError."""
    __slots__ = ("data", "at")

    def __init__(self, data, at=0):
        self.data, self.at = data, at

    @property
    def left(self):
        return len(self.data) - self.at

    def take(self, count):
        at = self.at
        if count > len(self.data) - at:
            raise FormatError(f"cut short: {count} bytes at {at} of {len(self.data)}")
        self.at = at + count
        return self.data[at:at + count]

    def rest(self):
        return self.take(self.left)

    def numbers(self, code):
        return struct.unpack("<" + code, self.take(struct.calcsize("<" + code)))

    def u8(self):
        return self.take(1)[0]

    def u64(self):
        return self.numbers("Q")[0]

    def f64(self):
        return self.numbers("d")[0]

    def varint(self):
        result = shift = 0
        while True:
            byte = self.take(1)[0]
            result |= (byte & 127) << shift
            if byte < 128:
                if result > _M64:
                    raise FormatError(f"a number of more than 64 bits at {self.at}")
                return result
            shift += 7
            if shift > 63:
                raise FormatError(f"a number without end at {self.at}")

    def count(self, least):
        """A count of things of at least so many bytes each."""
        count = self.varint()
        if count * least > self.left:
            raise FormatError(f"{count} elements in {self.left} bytes")
        return count

    def signed(self):
        coded = self.varint()
        return coded >> 1 ^ -(coded & 1)

    def node(self, previous):
        return _sum_of_nodes(previous, self.signed())

    def text(self):
        return self.take(self.varint()).decode("utf-8", "replace")

    def texts(self):
        return [self.text() for _ in range(self.count(1))]

    def part(self):
        return _Reader(self.take(self.varint()))


def _sum_of_nodes(previous, difference):
    node = previous + difference
    if not 0 <= node <= 0xFFFFFFFF:
        raise FormatError(f"node number {node}")
    return node


_NAMES = ("Bool Int32 Float Double Time String Node Color ColorRGBA Image Vec2f Vec2d Vec3f Vec3d Vec4f Vec4d Rotation "
          "Matrix3f Matrix3d Matrix4f Matrix4d Custom").split()
# NumPy's name and shape of an element; strings and images have another form.
_LAYOUT = [("?", ()), ("<i4", ()), ("<f4", ()), ("<f8", ()), ("<f8", ()), None, ("<u4", ()), ("<f4", (3,)), ("<f4", (4,)), None, ("<f4", (2,)),
           ("<f8", (2,)), ("<f4", (3,)), ("<f8", (3,)), ("<f4", (4,)), ("<f8", (4,)), ("<f4", (4,)), ("<f4", (3, 3)), ("<f8", (3, 3)),
           ("<f4", (4, 4)), ("<f8", (4, 4)), None]
_SIZES = [layout and np.dtype(layout[0]).itemsize * math.prod(layout[1]) for layout in _LAYOUT]
_BOOL, _STRING, _NODE, _IMAGE, _ROTATION, _CUSTOM = 0, 5, 6, 9, 16, 21
_CUSTOM_CODES = ("u1", "<i4", "<f4", "<f8")  # of a type from outside: bytes or numbers
_SFNODE, _MFNODE, _SFROTATION = 12, 13, 32
_LANES = {2 * k: _SIZES[k] // 4 for k, layout in enumerate(_LAYOUT) if layout and layout[0] == "<f4" and _SIZES[k] <= 16}  # of predicted types
_PACKED = {3: 1, **{kind + 1: lanes for kind, lanes in _LANES.items()}}  # of types in packed arrays


def _type_name(kind):
    return ("MF" if kind % 2 else "SF") + _NAMES[kind // 2]


def _known(kind):
    if kind // 2 >= len(_NAMES):
        raise FormatError(f"value type {kind}")
    return kind


def _read_bytes(r, kind):
    """A value as the bytes that its hash is of. These are what scenes here hold."""
    k = kind // 2
    size = _SIZES[k]
    if size:
        data = r.take(r.count(size) * size if kind % 2 else size)
        if k == _BOOL and data.count(0) + data.count(1) != len(data):
            raise FormatError("a boolean is 0 or 1")
        return data
    unit = 4 if k == _IMAGE else 1
    if kind % 2 == 0:
        data = r.take(unit * r.count(unit))
        if k == _CUSTOM:
            _custom(data)
        return data
    parts = [r.take(unit * r.count(unit)) for _ in range(r.count(1))]
    if k == _CUSTOM:
        for part in parts:
            _custom(part)
    return b"".join(len(part).to_bytes(8, "little") + part for part in parts)


def _parts_of(data):
    at = 0
    while at < len(data):
        size = _U64(data, at)[0]
        yield data[at + 8:at + 8 + size]
        at += 8 + size


def _custom_head(of, count, name):
    """What each value of a field type from outside begins with, and the bytes that follow (0: as many as it wants)."""
    plain = name.isascii() and name.replace("_", "a").isalnum() and "A" <= name[0] <= "Z" and len(name) <= 64
    if of >= len(_CUSTOM_CODES) or count > 1024 or (count == 0 and of != 0) or not plain or name in _NAMES:
        raise FormatError("a field type from outside without a name or a layout")
    return struct.pack("<BHB", of, count, len(name)) + name.encode(), count * np.dtype(_CUSTOM_CODES[of]).itemsize


def _custom(data):
    """A value of a field type from outside: a number, an array of them, or bytes."""
    if len(data) < 4:
        raise FormatError("a value of a field type from outside that does not say what it is")
    of, count, length = struct.unpack_from("<BHB", data)
    head, size = _custom_head(of, count, bytes(data[4:4 + length]).decode("ascii", "replace") or "-")
    rest = bytes(data[len(head):])
    if len(data) < len(head) or size not in (0, len(rest)):
        raise FormatError("a value of a field type from outside that does not say what it is")
    if of == 0:
        return rest
    array = np.frombuffer(rest, _CUSTOM_CODES[of])
    return array[0].item() if count == 1 else array


def _picture(words):
    """An SFImage: height x width x components bytes, the top row first."""
    words = np.frombuffer(words, "<i4")
    if len(words) < 3 or words[:3].min() < 0 or words[2] > 4 or len(words) - 3 != words[0] * words[1]:
        return np.zeros((0, 0, 0), np.uint8)
    width, height, components = (int(n) for n in words[:3])
    pixels = words[3:].reshape(height, width)[::-1]
    return np.stack([pixels >> 8 * c & 255 for c in range(components - 1, -1, -1)], axis=-1).astype(np.uint8) if components else pixels[..., None][..., :0].astype(np.uint8)


def _plain(kind, data):
    """The value in Python, nodes as numbers. Arrays are read-only views of `data`."""
    k = kind // 2
    if k == _STRING:
        return tuple(part.decode("utf-8", "replace") for part in _parts_of(data)) if kind % 2 else data.decode("utf-8", "replace")
    if k == _CUSTOM:
        return tuple(_custom(part) for part in _parts_of(data)) if kind % 2 else _custom(data)
    if k == _IMAGE:
        return tuple(_picture(part) for part in _parts_of(data)) if kind % 2 else _picture(data)
    code, shape = _LAYOUT[k]
    array = np.frombuffer(data, code)
    if k == _NODE and kind % 2:
        return tuple(array.tolist())
    if kind % 2:
        return array.reshape(-1, *shape)
    return array.reshape(shape) if shape else array[0].item()


def _zero(kind):
    k = kind // 2
    if kind % 2 or not _SIZES[k]:
        return b""
    if k == _ROTATION:
        return struct.pack("<4f", 0, 0, 1, 0)
    code, shape = _LAYOUT[k]
    return (np.eye(shape[0], dtype=code) if len(shape) == 2 else np.zeros(shape, code)).tobytes()


def _numbers_for(kind, value, path):
    """An array of the field's own numbers; what suits is what the extension takes."""
    k = kind // 2
    code, shape = _LAYOUT[k]
    array = np.asarray(value)
    suits = {"?": "b", "<i4": "iu", "<f4": "fiu", "<f8": "fiu"}[code]
    if array.size and array.dtype.kind not in suits:
        raise TypeError(f"{path} is {_type_name(kind)}: NumPy's kind '{array.dtype.kind}' does not suit")
    if code == "<i4" and array.size and not (-2**31 <= int(array.min()) and int(array.max()) < 2**31):
        raise OverflowError(f"{path} is {_type_name(kind)}: a number beyond 32 bits")
    if array.shape[kind % 2:] != shape and not (kind % 2 and not array.size):
        raise ValueError(f"{path} is {_type_name(kind)}: expected the shape {('n',) + shape if kind % 2 else shape}, not {array.shape}")
    return array.astype(code)


def _wire_of(kind, value, path):
    """A value as it is sent."""
    k, many = kind // 2, kind % 2
    if k == _STRING:
        if many and isinstance(value, str) or not all(isinstance(one, str) for one in (value if many else (value,))):
            raise TypeError(f"{path} is {_type_name(kind)}: expected " + ("a list of str" if many else "str"))
        parts = [_text(one) for one in (value if many else (value,))]
        return (_varint(len(parts)) if many else b"") + b"".join(parts)
    if k == _CUSTOM:
        raise NoExtension(f"{path}: values of field types from outside are sent by the extension module alone")
    if k == _IMAGE:
        raise NoExtension(f"{path}: pictures are sent by the extension module alone")
    numbers = _numbers_for(kind, value, path)
    return (_varint(len(numbers)) if many else b"") + numbers.tobytes()


def _varint(number):
    out = bytearray()
    while number >= 128:
        out.append(number & 127 | 128)
        number >>= 7
    out.append(number)
    return bytes(out)


def _zigzag(number):
    return _varint(2 * number if number >= 0 else -2 * number - 1)


def _text(text):
    data = text.encode()
    return _varint(len(data)) + data


# ---- types -----------------------------------------------------------------------------------------------------------

class _Field:
    __slots__ = ("name", "kind", "access", "hidden", "key", "default")

    def __init__(self, r):
        self.name, self.kind = r.text(), _known(r.u8())
        use, flags = r.numbers("BB")
        self.access, self.hidden = use & 3, bool(flags & 2)
        r.take(8 * ((flags >> 2 & 1) + (flags >> 3 & 1)))
        for bit in (16, 32):
            if flags & bit:
                r.texts()
        self.default = _read_bytes(r, self.kind) if flags & 64 else _zero(self.kind)
        if self.kind // 2 == _CUSTOM:
            of, count = r.numbers("BH")
            head, size = _custom_head(of, count, r.text() or "-")
            if self.kind % 2 == 0 and not flags & 64:
                self.default = head + bytes(size)
        self.key = xxh3_64(self.name.encode() + (b"\0" if self.hidden else b""))


class _Type:
    __slots__ = ("name", "fields", "key", "index")

    def __init__(self, name, fields):
        self.name, self.fields, self.key = name, fields, xxh3_64(name.encode())
        self.index = {field.name: i for i, field in enumerate(fields)}


@functools.lru_cache(4096)  # keyframes describe the same types again and again
def _type_from(data):
    r = _Reader(data)
    name, _, _, _, _, _, _ = r.text(), r.text(), r.varint(), r.u8(), r.text(), r.texts(), r.text()
    return _Type(name, [_Field(r.part()) for _ in range(r.count(1))])


def _read_type(r):
    return _type_from(bytes(r.take(r.varint())))


@functools.lru_cache(None)
def _of_protocol(name):
    """A file of the protocol: beside this one, or in the source tree."""
    beside = os.path.dirname(os.path.abspath(__file__))
    tree = os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "..", "sync")
    for folder in (beside, tree):
        if os.path.exists(os.path.join(folder, name)):
            with open(os.path.join(folder, name), "rb") as file:
                return file.read()
    raise Error(f"{name} is not beside {__file__}: scene files cannot be read without it", code="file")


@functools.lru_cache(None)
def _catalogue():
    r, types = _Reader(_of_protocol("catalogue.bin")), []
    while r.left:
        types.append(bytes(r.take(r.varint())))
    return types


# ---- prediction ------------------------------------------------------------------------------------------------------

_UNKNOWN = 33  # a size
_CLASSES = [1, 2, 3, 4, 4, 5, 5, 6, 6, 6, 7, 7, 7, 7] + [8] * 6 + [9] * 13 + [0]
_RATES = (1, 2, 3, 3, 4, 4, 4, 4, 4, 4, 5, 5, 5, 5, 5, 5)
_LARGEST_F32 = 3.4028234663852886e38
_PAST_FIELDS = 1 << 22
_PACK_F, _PACK_I = struct.Struct("<f"), struct.Struct("<i")


def _signed(n):
    n &= 0xFFFFFFFF
    return n - (n >> 31 << 32)


def _flipped(n):
    """Bits of an f32 as a number that grows with it, and back; both signed."""
    return n ^ 0x7FFFFFFF if n < 0 else n


def _to_float(n):
    return _PACK_F.unpack(_PACK_I.pack(_flipped(n)))[0]


def _of_float(x):
    try:
        return _flipped(_PACK_I.unpack(_PACK_F.pack(x))[0])
    except OverflowError:  # which an f32 rounds to infinity
        return _of_float(math.copysign(math.inf, x))


def _to_grid(kind, numbers, width):
    floats = [_to_float(n) for n in numbers]
    if kind == _SFROTATION:
        floats = [x * floats[3] for x in floats[:3]]
    places = [round(x / width) if abs(x / width) < 2**21 else 0 for x in floats]  # what is no number is not below either
    return [n if abs(n) < 2**21 else 0 for n in places]


def _from_grid(kind, places, width):
    x = [n * width for n in places]
    if kind == _SFROTATION:
        angle = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
        x = [x[0] / angle, x[1] / angle, x[2] / angle, angle] if angle > 0 else [0.0, 0.0, 1.0, 0.0]
    return [_of_float(n) for n in x]


class _Past:
    """What is remembered of a field: up to three values as numbers, newest first; their count is the depth."""
    __slots__ = ("values", "width", "sync", "orders", "sizes")

    def __init__(self, numbers, sync):
        self.values, self.width, self.sync = [numbers], 0, sync
        self.orders, self.sizes = [0] * 4, [_UNKNOWN] * 4

    def bring(self, kind, width):
        if self.width == width:
            return
        if self.width:
            self.values = [_from_grid(kind, n, self.width) for n in self.values]
        if width:
            self.values = [_to_grid(kind, n, width) for n in self.values]
        self.width = width

    def forecasts(self, lane):
        """By each order that the depth allows."""
        last = [n[lane] for n in self.values]
        result = last[:1]
        if len(last) > 1:
            x = last if self.width else [_to_float(n) for n in last]
            for next_ in (2 * x[0] - x[1], *((3 * (x[0] - x[1]) + x[2],) if len(x) > 2 else ())):
                result.append(_signed(next_) if self.width else _of_float(next_) if abs(next_) <= _LARGEST_F32 else last[0])
        return result

    def longest(self):
        """The component of a unit axis that follows from the others; none where it is not of unit length."""
        axis = [_to_float(n) for n in self.values[0][:3]]
        if not abs(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2] - 1) < 1e-5:
            return None, 0
        lane = max(range(3), key=lambda i: abs(axis[i]))
        return lane, axis[lane]

    def code(self, kind, residual):
        """`residual(lane, foretold)` reads a difference or makes it. Learns from the new numbers and returns them."""
        lanes = 3 if kind == _SFROTATION and self.width else _LANES[kind]
        last, sign = self.longest() if kind == _SFROTATION and not self.width else (None, 0)
        forecasts = [self.forecasts(lane) for lane in range(lanes)]
        now, sizes, depth = [0] * lanes, [_UNKNOWN] * 4, len(self.values)
        order = [lane for lane in range(lanes) if lane != last] + ([] if last is None else [last])
        for lane in order:
            if lane == last:
                p, q = (_to_float(now[i]) for i in range(3) if i != lane)
                square = 1 - p * p - q * q
                size = math.sqrt(square) if square > 0 else 0.0
                foretold = _of_float(-size if sign < 0 else size)
            else:
                foretold = forecasts[lane][min(self.orders[lane], depth - 1)]
            difference = residual(lane, foretold)
            now[lane], sizes[lane] = _signed(foretold + difference), abs(difference).bit_length()
        self.orders = [0] * 4
        for lane in range(lanes):
            misses = [abs(_signed(now[lane] - foretold)) for foretold in forecasts[lane]]
            self.orders[lane] = misses.index(min(misses)) if depth > 1 else 1
        self.sizes, self.values = sizes, [now, *self.values[:2]]
        return now


class _Bits:
    """Bits, least significant first in each byte."""

    def __init__(self, data):
        self.data, self.at, self.word, self.filled = data, 0, 0, 0

    def get(self, count):
        while self.filled < count:
            chunk = self.data[self.at:self.at + 8]
            if not chunk:
                raise FormatError("residuals cut short")
            self.word |= int.from_bytes(chunk, "little") << self.filled
            self.filled += 8 * len(chunk)
            self.at += 8
        result = self.word & (1 << count) - 1
        self.word >>= count
        self.filled -= count
        return result

    def packed(self, size):
        width = 12 if size == _UNKNOWN else size + 1 if size else 0
        while width < 32 and self.get(1):
            width += 3
        coded = self.get(min(width, 32))
        return coded >> 1 ^ -(coded & 1)


class _RangeCoder:
    def __init__(self, data, models):
        self.data, self.models, self.at, self.range = data, models, 4, 0xFFFFFFFF
        self.code = int.from_bytes((data + bytes(4))[:4], "big")

    def decide(self, key):
        zero, seen = self.models.get(key, (1 << 14, 0))
        bound = (self.range >> 15) * zero
        if self.code < bound:
            bit, self.range, zero = 0, bound, zero + (32768 - zero >> _RATES[seen])
        else:
            bit, zero = 1, zero - (zero >> _RATES[seen])
            self.code -= bound
            self.range -= bound
        self.models[key] = zero, min(seen + 1, 15)
        while self.range < 1 << 24:
            self.range <<= 8
            self.code = self.code << 8 & 0xFFFFFFFF | (self.data[self.at] if self.at < len(self.data) else 0)
            self.at += 1
        return bit

    def number(self, plain, model, size):
        class_ = _CLASSES[size]
        if not self.decide((0, model, class_)):
            return 0
        path = 1
        for _ in range(5):
            path = path << 1 | self.decide((1, model, class_, path))
        bits, negative, magnitude = (path & 31) + 1, self.decide((2, model, class_)), 1
        if bits >= 2:
            magnitude = 2 | self.decide((3, model, bits))
        if bits >= 3:
            magnitude = magnitude << bits - 2 | plain.get(bits - 2)
        return -magnitude if negative else magnitude


def _read_runs(r, count):
    nodes, node = [], 0
    for _ in range(r.count(2)):
        node = r.node(node)
        more = r.varint()
        step = r.signed() if more else 0
        if len(nodes) + more + 1 > count:
            raise FormatError("more nodes in runs than in the column")
        nodes += [node + k * step for k in range(more + 1)]
        node = nodes[-1]
    if len(nodes) != count or nodes and not 0 <= min(nodes) <= max(nodes) <= 0xFFFFFFFF:
        raise FormatError("runs that are not the column's nodes")
    return nodes


class _Memory:
    """What the reader of one stream remembers."""

    def __init__(self):
        self.pasts, self.models, self.syncs, self.before = {}, {}, 0, []

    def begin(self, flags):
        if flags & 4:
            self.pasts = {}
        if flags & 6:
            self.models = {}
            self.syncs += 1
        self.before = []

    def past(self, key):
        past = self.pasts.get(key)
        if past and past.sync != self.syncs:
            past.values, past.sizes, past.sync = past.values[:1], [_UNKNOWN] * 4, self.syncs
        return past

    def remember(self, node, field, kind, data):
        """Learns from a raw value."""
        key, numbers = (node, field, kind), [_flipped(n) for n in struct.unpack(f"<{_LANES[kind]}i", data)]
        past = self.past(key)
        if past is None:
            if len(self.pasts) >= _PAST_FIELDS:
                raise FormatError("more fields to remember than a stream may have")
            self.pasts[key] = _Past(numbers, self.syncs)
            return
        past.bring(kind, 0)
        past.code(kind, lambda lane, foretold: _signed(numbers[lane] - foretold))

    def column(self, r, count, coding, kind, field):
        """The rest of a column of coding 1 or 2: (node, bytes) one by one."""
        form = r.u8()
        width, how = r.f64() if form & 1 else 0, form >> 1 & 3
        if kind not in _LANES or form & 1 and not 0 < width < math.inf or how == 3 and coding != 2:
            raise FormatError("a malformed column")
        node, size, nodes = 0, _UNKNOWN, []
        if how == 0:
            nodes = [node := r.node(node) for _ in range(count)]
        elif how == 1:
            nodes = _read_runs(r, count)
        elif how == 2:
            nodes = self.before
            if len(nodes) != count:
                raise FormatError("a column of the nodes before has as many")
        coder = _RangeCoder(r.take(r.varint()), self.models.setdefault((field, kind, bool(width)), {})) if coding == 2 else None
        plain, node, lanes = _Bits(r.rest()), 0, _LANES[kind]
        pack = struct.Struct(f"<{lanes}i").pack
        for i in range(count):
            if how == 3:
                gap = coder.number(plain, 4, size)
                node, size = _sum_of_nodes(node, gap), abs(gap).bit_length()
                nodes.append(node)
            past = self.past((nodes[i], field, kind))
            if past is None:
                raise FormatError(f"a foretold value of node {nodes[i]}, of which nothing is known")
            past.bring(kind, width)
            sizes = past.sizes
            if coder:
                now = past.code(kind, lambda lane, _, s=sizes: coder.number(plain, lane, s[lane]))
            else:
                now = past.code(kind, lambda lane, _, s=sizes: plain.packed(s[lane]))
            yield nodes[i], pack(*[_flipped(n) for n in (_from_grid(kind, now, width) if width else now)])
        self.before = nodes


# ---- packed arrays ---------------------------------------------------------------------------------------------------

_BLOCK, _SMALLEST_LANE = 1024, 10


def _unpacked(data, count, bits):
    """`count` numbers of so many bits each."""
    if bits == 0:
        return np.zeros(count, np.uint32)
    ones = np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little")[:count * bits].reshape(count, bits)
    return (ones.astype(np.uint64) << np.arange(bits, dtype=np.uint64)).sum(axis=1, dtype=np.uint64).astype(np.uint32)


def _lane(r, size, is_float):
    """One component of a block as 32-bit words."""
    form, lag, base = r.numbers("BBI")
    bits, decimal = form & 127, form & 128
    exponent, odd = r.numbers("BB") if decimal else (0, 0)
    if bits > 32 or not 1 <= lag <= 8 or decimal and not is_float or exponent > 10 or odd > 32:
        raise FormatError("unknown packing")
    odds = [r.numbers("HI") for _ in range(odd)]
    if any(at >= size for at, _ in odds):
        raise FormatError("a number beyond its block")
    first = min(lag, size)
    steps = np.empty(size, np.uint32)
    steps[:first] = r.numbers(f"{first}I")
    steps[first:] = _unpacked(r.take((bits * (size - first) + 7) // 8), size - first, bits) + np.uint32(base)
    words = np.empty(size, np.uint32)
    for start in range(first):
        words[start::lag] = np.cumsum(steps[start::lag], dtype=np.uint32)
    if decimal:
        words = (words.view(np.int32) / 10.0**exponent).astype(np.float32).view(np.uint32)
    elif is_float:
        words = np.where(words >> 31, words ^ np.uint32(0x7FFFFFFF), words)
    for at, word in odds:
        words[at] = word
    return words


def _read_packed(r, kind, charge):
    lanes, size = _PACKED.get(kind), r.varint()
    if not lanes or -(-size // _BLOCK) * lanes * _SMALLEST_LANE > r.left:
        raise FormatError(f"{size} packed elements of type {kind} in {r.left} bytes")
    charge(4 * size * lanes)
    words = np.empty((size, lanes), "<u4")
    for at in range(0, size, _BLOCK):
        for lane in range(lanes):
            words[at:at + _BLOCK, lane] = _lane(r, min(_BLOCK, size - at), kind != 3)
    return words.tobytes()


# ---- scenes ----------------------------------------------------------------------------------------------------------

_KINDS = ("define_type", "create_node", "set_field", "insert_child", "remove_child", "set_name", "add_route", "remove_route", "destroy_node", "event")
_SPREAD = 0x9E3779B97F4A7C15


class _Inside:
    """What a scene holds of a node. Values are bytes, of MFNode lists of numbers; those missing are the defaults."""
    __slots__ = ("type", "scope", "name", "values", "terms", "routes")

    def __init__(self, type_, scope):
        self.type, self.scope, self.name = type_, scope, b""
        self.values, self.terms, self.routes = {}, {}, set()


class Scene:
    """A scene that is read from a log or follows another one: `scene["DOOR"].rotation`. It is not edited here."""

    def __init__(self):
        self.closed = False
        self._old_hashes = False  # of version 2, which count fields
        self._subscribers = []
        self._reset()

    def _reset(self):
        self._nodes = {1: _Inside(_Type("RtsgScene", []), 0)}
        self._sum, self.number, self.now, self._changes, self._names, self._shape = 0, 0, 0.0, [], None, 0

    # ---- reading --------------------------------------------------------------------------------------------------

    @property
    def hash(self):
        """The state hash, 32 hexadecimal digits."""
        return f"{self._sum & _M128:032x}"

    @property
    def root(self):
        return Node(self, 1)

    @property
    def routes(self):
        """("FROM.field", "TO.field") of each route."""
        return [(self._path(n, f), self._path(to, g)) for n, inside in self._nodes.items() for f, to, g, connection in inside.routes if not connection]

    def __len__(self):
        return len(self._nodes)

    def __iter__(self):
        return iter(self.nodes())

    def __contains__(self, name):
        return self._find(name) is not None

    def __getitem__(self, name):
        found = self._find(name)
        if found is None:
            raise NoSuchName(f"there is no node {name}", code="no-such-node")
        return Node(self, found)

    def __getattr__(self, name):
        raise NoExtension(f"Scene.{name} is not in the reader in Python alone; it needs the extension module rtsg._rtsg")

    def node(self, node_id):
        return self[f"#{node_id}"]

    def nodes(self, type_name=""):
        """All nodes, or those of a type."""
        return [Node(self, n) for n, inside in sorted(self._nodes.items()) if type_name in ("", inside.type.name)]

    def value(self, path):
        """Of "NODE.field"."""
        node, _, field = path.rpartition(".")
        return self[node][field]

    def subscribe(self, function):
        """Calls function(changes) with each ChangeSet from now on."""
        self._subscribers.append(function)

    def _find(self, name):
        if re.fullmatch("#[0-9]+", name):
            return int(name[1:]) if int(name[1:]) in self._nodes else None
        if self._names is None:
            self._names = {(inside.scope, inside.name.decode("utf-8", "replace")): n for n, inside in sorted(self._nodes.items(), reverse=True) if inside.name}
        scope = 0
        for part in name.split("/"):
            scope = self._names.get((scope, part))
            if scope is None:
                return None
        return scope

    def _label(self, n):
        inside = self._nodes.get(n)
        return inside.name.decode("utf-8", "replace") if inside and inside.name else f"#{n}"

    def _path(self, n, field):
        inside = self._nodes.get(n)
        return f"{self._label(n)}.{inside.type.fields[field].name}" if inside and field < len(inside.type.fields) else self._label(n)

    def _scoped_name(self, n):
        """With the names of scopes in front; empty where one has none."""
        path = []
        while n:
            inside = self._nodes.get(n)
            if not inside or not inside.name:
                return ""
            path.insert(0, inside.name.decode("utf-8", "replace"))
            n = inside.scope
        return "/".join(path)

    def _raw(self, n, field):
        """The bytes of a value; of MFNode a tuple of numbers."""
        inside = self._nodes[n]
        value = inside.values.get(field)
        if value is None:
            value = inside.type.fields[field].default
        return tuple(value) if isinstance(value, list) else value

    def _in_python(self, kind, raw):
        plain = raw if isinstance(raw, tuple) else _plain(kind, raw)
        if kind == _SFNODE:
            return Node(self, plain) if plain else None
        return tuple(Node(self, n) if n else None for n in plain) if kind == _MFNODE else plain

    # ---- what a decoder calls ---------------------------------------------------------------------------------------

    def _inside(self, n):
        inside = self._nodes.get(n)
        if inside is None:
            raise FormatError(f"there is no node {n}")
        return inside

    @staticmethod
    def _def(inside, field, kind=None):
        fields = inside.type.fields
        if field >= len(fields) or kind is not None and fields[field].kind != kind:
            raise FormatError(f"{inside.type.name} has no field {field}" + (f" of type {_type_name(kind)}" if kind is not None else ""))
        return fields[field]

    def _term(self, t, n, field, key, data):
        if self._old_hashes:
            return xxh3_128(data, n << 32 | (0xFFFF if field is None else field) << 16 | t)
        return xxh3_128(data, key + t + n * _SPREAD & _M64)

    def _note(self, kind, n, field=None, value=None, other=0, index=0):
        self._changes.append((kind, n, field, value, other, index))

    def _define(self, type_):
        if type_.name == "RtsgScene":
            self._nodes[1].type = type_

    def _create(self, n, type_, scope):
        if n == 0 or n in self._nodes:
            raise FormatError(f"node {n} is there already")
        self._nodes[n] = _Inside(type_, scope)
        self._sum += self._term(1, n, None, 0, struct.pack("<QQ", type_.key, scope))
        self._names = None
        self._shape += 1
        self._note(1, n)

    def _set(self, n, field, kind, data):
        inside = self._inside(n)
        def_ = self._def(inside, field, kind)
        term = 0 if data == def_.default else self._term(2, n, field, def_.key, data)
        self._sum += term - inside.terms.get(field, 0)
        inside.terms[field], inside.values[field] = term, data
        self._note(2, n, field, data)

    def _neighbours(self, n, field, key, a, b):
        return self._term(3, n, field, key, struct.pack("<II", a, b)) if a or b else 0

    def _list_terms(self, n, field, key, children):
        around = [0, *children, 0]
        return sum(self._neighbours(n, field, key, a, b) for a, b in zip(around, around[1:]))

    def _set_list(self, n, field, children):
        inside = self._inside(n)
        key = self._def(inside, field, _MFNODE).key
        self._sum += self._list_terms(n, field, key, children) - self._list_terms(n, field, key, inside.values.get(field, []))
        inside.values[field] = children
        self._note(2, n, field, tuple(children))

    def _link(self, n, field, child, index, inserts):
        inside = self._inside(n)
        key, children = self._def(inside, field, _MFNODE).key, inside.values.setdefault(field, [])
        if index > len(children) - (not inserts) or not inserts and children[index] != child:
            raise FormatError(f"node {child} at place {index} of {len(children)}")
        if not inserts:
            del children[index]
        before, after = children[index - 1] if index else 0, children[index] if index < len(children) else 0
        linked = self._neighbours(n, field, key, before, child) + self._neighbours(n, field, key, child, after) - self._neighbours(n, field, key, before, after)
        if inserts:
            children.insert(index, child)
        self._sum += linked if inserts else -linked
        self._note(3 if inserts else 4, n, field, None, child, index)

    def _name_term(self, n, name):
        return self._term(4, n, None, 0, name) if name else 0

    def _set_name(self, n, name):
        inside = self._inside(n)
        self._sum += self._name_term(n, name) - self._name_term(n, inside.name)
        inside.name, self._names = name, None
        self._shape += 1
        self._note(5, n, None, name)

    def _route(self, adds, n, field, to, to_field, connection):
        inside, route = self._inside(n), (field, to, to_field, connection)
        key, target = self._def(inside, field).key, self._def(self._inside(to), to_field).key
        if adds == (route in inside.routes):
            raise FormatError(f"a route of node {n} is {'there already' if adds else 'not there'}")
        (inside.routes.add if adds else inside.routes.remove)(route)
        data = struct.pack("<II", to, to_field + 0x10000 * connection) if self._old_hashes else struct.pack("<QII", target, to, connection)
        self._sum += self._term(5, n, field, key, data) * (1 if adds else -1)
        self._note(6 if adds else 7, n, field, None, to, to_field)

    def _destroy(self, n):
        inside = self._inside(n)
        if n == 1:
            raise FormatError("the root cannot be destroyed")
        self._sum -= self._term(1, n, None, 0, struct.pack("<QQ", inside.type.key, inside.scope)) + self._name_term(n, inside.name)
        self._sum -= sum(inside.terms.values())
        for field, value in inside.values.items():
            if isinstance(value, list):
                self._sum -= self._list_terms(n, field, inside.type.fields[field].key, value)
        del self._nodes[n]
        self._names = None
        self._shape += 1
        self._note(8, n)

    # ---- following --------------------------------------------------------------------------------------------------

    def _apply(self, record, decoder):
        """A frame that follows from this state, or a whole state. Returns the ChangeSet."""
        if record.kind != _FRAME and not (record.origin == self.number and len(self._nodes) == 1):
            self._reset()
        if record.origin != self.number:
            raise FormatError(f"a frame from state {record.origin} in state {self.number}")
        self._changes = []
        decoder.decode(record, self)
        self.number, self.now = record.to, record.time
        self._sum &= _M128
        changes = ChangeSet(self, record, self._changes)
        for function in tuple(self._subscribers):
            function(changes)
        return changes

    def dump(self):
        """All that is not a default, as what JSON takes; as tests/sync/conformance has it."""
        nodes, routes = {}, []
        for n, inside in sorted(self._nodes.items()):
            fields = {}
            for field, value in sorted(inside.values.items()):
                if value if isinstance(value, list) else inside.terms.get(field):
                    fields[inside.type.fields[field].name] = list(value) if isinstance(value, list) else _for_json(inside.type.fields[field].kind, value)
            nodes[str(n)] = {"type": inside.type.name, **({"name": inside.name.decode("utf-8", "replace")} if inside.name else {}),
                             **({"scope": inside.scope} if inside.scope else {}), "fields": fields}
            for field, to, to_field, connection in inside.routes:
                routes.append(f"{'IS' if connection else 'ROUTE'} {n}.{inside.type.fields[field].name} TO {to}.{self._nodes[to].type.fields[to_field].name}")
        return {"state": self.number, "hash": self.hash, "nodes": nodes, "routes": sorted(routes)}


def _for_json(kind, data):
    if kind // 2 == _IMAGE:
        lists = [np.frombuffer(part, "<i4").tolist() for part in (_parts_of(data) if kind % 2 else (data,))]
        return lists if kind % 2 else lists[0]
    plain = _plain(kind, data)
    if kind // 2 == _CUSTOM:
        texts = ["0x" + one.hex() if isinstance(one, bytes) else np.asarray(one).tolist() for one in (plain if kind % 2 else (plain,))]
        return texts if kind % 2 else texts[0]
    if isinstance(plain, np.ndarray):
        return (plain.reshape(len(plain), -1) if kind % 2 and plain.ndim > 1 and len(plain) else plain.ravel()).tolist()
    return list(plain) if isinstance(plain, tuple) else plain


class Node:
    """A node of a scene. Its fields are its attributes, or its items: light["global"]."""
    __slots__ = ("_scene", "node_id")

    def __init__(self, scene, node_id):
        object.__setattr__(self, "_scene", scene)
        object.__setattr__(self, "node_id", node_id)

    def _inside(self):
        inside = self._scene._nodes.get(self.node_id)
        if inside is None:
            raise NoSuchName(f"there is no node #{self.node_id} any more", code="no-such-node")
        return inside

    def __getattr__(self, name):
        inside = self._inside()
        field = inside.type.index.get(name)
        if field is None:
            raise NoSuchField(f"{inside.type.name} has no field {name}", code="no-such-field")
        if inside.type.fields[field].access == 1:
            raise Error(f"{self._scene._label(self.node_id)}.{name} is an input and has no value", code="access")
        return self._scene._in_python(inside.type.fields[field].kind, self._scene._raw(self.node_id, field))

    __getitem__ = __getattr__

    def __setattr__(self, name, value):
        raise Error("this scene follows another one, or a log, and is not edited here; Follower.edit() and send() ask the origin", code="access")

    __setitem__ = __setattr__

    def_name = property(lambda self: self._inside().name.decode("utf-8", "replace") or None, doc="The DEF name; None: it has none.")
    type_name = property(lambda self: self._inside().type.name, doc="\"Transform\", say.")
    field_names = property(lambda self: tuple(f.name for f in self._inside().type.fields if not f.hidden), doc="The names of its fields.")
    field_types = property(lambda self: {f.name: _type_name(f.kind) for f in self._inside().type.fields if not f.hidden}, doc="The type of each field.")
    is_alive = property(lambda self: self.node_id in self._scene._nodes, doc="False once it was destroyed.")

    def __eq__(self, other):
        return isinstance(other, Node) and other._scene is self._scene and other.node_id == self.node_id

    def __hash__(self):
        return hash((id(self._scene), self.node_id))

    def __repr__(self):
        return f"<rtsg.Node {self.type_name} {self._scene._label(self.node_id)}>" if self.is_alive else f"<rtsg.Node #{self.node_id}, gone>"


class Change:
    """One change of a ChangeSet; `kind` as the extension names it."""
    __slots__ = ("kind", "node", "field", "path", "value", "other", "index")

    def __init__(self, scene, kind, n, field, value, other, index):
        inside = scene._nodes.get(n)
        def_ = inside.type.fields[field] if inside and field is not None and field < len(inside.type.fields) else None
        self.kind, self.node, self.field, self.index = _KINDS[kind], Node(scene, n), def_ and def_.name, index
        self.path = scene._path(n, field) if def_ else scene._label(n)
        self.other = Node(scene, other) if other else None
        self.value = value.decode("utf-8", "replace") if kind == 5 else scene._in_python(def_.kind, value) if kind in (2, 9) and def_ else None


class ChangeSet:
    """The changes that lead from one state to the next; a sequence of Change."""

    def __init__(self, scene, record, changes):
        self.scene, self.number, self.since, self.time, self.hash = scene, record.to, record.origin, record.time, record.hash
        self.is_snapshot, self._all = record.origin == 0, changes

    def __len__(self):
        return len(self._all)

    def __getitem__(self, what):
        if not isinstance(what, str):
            return Change(self.scene, *self._all[what])
        found = self.get(what, self)
        if found is self:
            raise KeyError(f"{what} is not in this set")
        return found

    def __contains__(self, path):
        return self.get(path, self) is not self

    def get(self, path, default=None):
        """The new value of "NODE.field", or `default`."""
        name, _, field = path.rpartition(".")
        node = self.scene[name]
        index = self.scene._nodes[node.node_id].type.index.get(field)
        if index is None:
            raise NoSuchName(f"{node.type_name} has no field {field}", code="no-such-field")
        kind = self.scene._nodes[node.node_id].type.fields[index].kind
        for what, n, at, value, _, _ in reversed(self._all):
            if what == 2 and n == node.node_id and at == index:
                return self.scene._in_python(kind, value)
        return default


# ---- records ---------------------------------------------------------------------------------------------------------

_HEAD, _FRAME, _KEYFRAME, _INDEX, _INPUT, _REQUEST, _SCENE = range(1, 8)
_MAGIC, _HEADER, _MOST_RECORD = b"RTSGrec1", 64, 1 << 30
_FREE, _CHANGE = 64 << 20, 40  # bytes that a record may take beside four times its length; what a change is charged


class _Record:
    __slots__ = ("kind", "flags", "origin", "to", "time", "hash", "payload", "size", "offset")

    def __init__(self, data, at=0, verify=True):
        """Raises FormatError that says what is wrong. Without `verify` only the header is looked at, and it has no payload."""
        head = data[at:at + _HEADER]
        if len(head) < _HEADER:
            raise FormatError(f"at byte {at}: a record cut short")
        magic, checksum, self.kind, self.flags, low, high, self.origin, self.to, self.time, a, b = struct.unpack("<8sQBBHIQQdQQ", head)
        length = low | high << 16
        if magic != _MAGIC or self.flags > 7 or length > _MOST_RECORD or not math.isfinite(self.time):
            raise FormatError(f"at byte {at}: no record")
        if length > len(data) - at - _HEADER:
            raise FormatError(f"at byte {at}: a record cut short")
        self.hash, self.size, self.offset, self.payload = f"{b:016x}{a:016x}", _HEADER + length, at, b""
        if verify:
            if xxh3_64(data[at + 16:at + self.size]) != checksum:
                raise FormatError(f"at byte {at}: a wrong checksum")
            self.payload = data[at + _HEADER:at + self.size]


class _Head:
    def __init__(self, payload):
        r = _Reader(payload)
        self.version, oldest, self.epoch, _, self.builtin, mode, _, self.error = r.numbers("HHQQHBBd")
        self.creator, self.mode = r.text(), mode
        self.start = r.f64() if r.left >= 8 else None
        if oldest > 3 or self.version < 2:
            raise FormatError(f"a stream of version {self.version} for readers of {oldest} and later; this one reads 2 and 3")
        if mode > 2:
            raise FormatError("a stream of an unknown mode")


class _Decoder:
    """Decodes the blocks of frames and whole states, and calls a Scene for each change."""

    def __init__(self):
        self.restart()

    def restart(self):
        self.types, self.catalogued, self.memory, self.counts = {}, 0, _Memory(), {}

    def decode(self, record, scene):
        self.counts, self.left, self.words = {}, 4 * record.size + _FREE, None
        self.memory.begin(record.flags if record.kind == _FRAME else 4)
        self.remembers = record.kind == _FRAME and bool(record.flags & 1)
        r = _Reader(record.payload)
        if record.kind == _SCENE:
            self.restart()
            version, self.catalogued, root = r.numbers("HHH")
            if version != 1:
                raise FormatError(f"a scene of version {version}; this reader knows 1")
            self.words = _of_protocol("words.bin")
            scene._define(self.type_of(root))
        self.blocks(r, scene, True)

    def charge(self, bytes_):
        self.left -= bytes_
        if self.left < 0:
            raise FormatError("a record that takes more memory than it may")

    def blocks(self, r, scene, may_inflate):
        while r.left:
            kind, count, body = r.u8(), r.varint(), r.part()
            if kind == 14:
                if may_inflate:
                    self.blocks(self.inflated(body), scene, False)
                continue
            if kind > 8:
                continue  # authors, fillers, and what later versions have
            self.charge(_CHANGE * count)
            self.counts[kind] = self.counts.get(kind, 0) + count
            if kind == 4:
                self.column(count, body, scene)
            else:
                self.rows(kind, count, body, scene)

    def inflated(self, body):
        size = body.varint()
        self.charge(size)
        try:
            inflater = zlib.decompressobj(-15, self.words) if self.words else zlib.decompressobj(-15)
            data = inflater.decompress(body.rest(), size + 1)
        except zlib.error as error:
            raise FormatError(f"a deflated block is damaged: {error}") from None
        if len(data) != size:
            raise FormatError(f"a deflated block of other than {size} bytes")
        return _Reader(data)

    def type_of(self, number):
        type_ = self.types.get(number)
        if type_ is None and number < self.catalogued:
            if number >= len(_catalogue()):
                raise FormatError(f"type {number} of the catalogue, which has {len(_catalogue())} here: the file is of a later version")
            type_ = self.types[number] = _type_from(_catalogue()[number])
        if type_ is None:
            raise FormatError(f"node type {number} is not described")
        return type_

    def rows(self, kind, count, b, scene):
        node = other = 0
        for _ in range(count):
            if kind < 2:
                number = b.varint() >> kind
                type_ = _read_type(b)
                if kind == 0 or number not in self.types:
                    self.types[number] = type_
                scene._define(self.types[number])
            elif kind == 3:
                node = self.link(b, node, scene)
            elif kind == 6:
                tag = b.u8()
                node = b.node(node)
                field, to = b.varint(), b.node(node)
                scene._route(not tag & 1, node, field, to, b.varint(), bool(tag & 4))
            else:
                coded = b.varint() >> 1
                node = _sum_of_nodes(node, coded >> 1 ^ -(coded & 1))
                if kind == 2:
                    type_, other = self.type_of(b.varint()), b.node(other)
                    scene._create(node, type_, other)
                elif kind == 5:
                    scene._set_name(node, bytes(b.take(b.varint())))
                elif kind == 7:
                    scene._destroy(node)
                else:
                    field, of = b.varint(), _known(b.u8())
                    scene._note(9, node, field, bytes(_read_bytes(b, of)))

    @staticmethod
    def link(b, before, scene):
        tag = b.u8()
        node, field = b.node(before), b.varint()
        if tag & 3 == 0:
            scene._set(node, field, _SFNODE, struct.pack("<I", b.node(node)))
        elif tag & 3 == 1:
            child = node
            scene._set_list(node, field, [child := b.node(child) for _ in range(b.count(1))])
        else:
            child, index = b.node(node), b.varint()
            scene._link(node, field, child, index, tag & 3 == 2)
        return node

    def column(self, count, b, scene):
        coding, _, kind = b.numbers("BBB")
        field = b.varint()
        if coding > 3:
            return  # of a later version
        if kind in (_SFNODE, _MFNODE):
            raise FormatError(f"a column of {_type_name(kind)}")
        _known(kind)
        if coding in (1, 2):
            if not self.remembers:
                raise FormatError("foretold values in a record that has none")
            for node, data in self.memory.column(b, count, coding, kind, field):
                scene._set(node, field, kind, data)
            self.counts["predicted"] = self.counts.get("predicted", 0) + count
            return
        if count > b.left:
            raise FormatError(f"{count} values in {b.left} bytes")
        node, learns = 0, self.remembers and kind in _LANES
        for node in [node := b.node(node) for _ in range(count)]:
            data = bytes(_read_packed(b, kind, self.charge) if coding == 3 else _read_bytes(b, kind))
            if learns:
                self.memory.remember(node, field, kind, data)
            scene._set(node, field, kind, data)


# ---- logs ------------------------------------------------------------------------------------------------------------

_SAME = 1e-6  # seconds; times since 1970 are exact to a quarter of that


def _records(data, at, damage, verify=True):
    """Every intact record from `at` on; calls damage(offset, length, why) of the bytes between."""
    lost = why = None
    while at < len(data):
        record = None
        try:
            record = _Record(data, at, verify)
        except FormatError as error:
            if lost is None:
                lost, why = at, error.text
            found = data.find(_MAGIC, at + 1)
            at = len(data) if found < 0 else found
        if lost is not None and (record or at >= len(data)):
            damage(lost, at - lost, why)
            lost = None
        if record:
            yield record
            at += record.size


class Log:
    """A log or scene file, and `scene`, which is brought to any state of it: at first to the first one."""

    def __init__(self, path):
        self._path = os.fspath(path)
        try:
            with open(self._path, "rb") as file:
                self._data = file.read()
        except OSError as error:
            raise Error(f"cannot be read: {error.strerror}", self._path, code="file") from None
        self.scene, self.changes, self._told = Scene(), None, False
        self._scan()
        self._rewind(0)
        if not self.step():
            raise Error("there is no intact state in it", self._path, code="log")

    def _scan(self):
        """Where whole states are, by headers alone. The time of a session that begins earlier goes on from the last one's end."""
        self._keyframes, head, shift, last = [], 0, 0.0, -math.inf
        for record in _records(self._data, 0, lambda *_: None, verify=False):
            if record.kind == _HEAD:
                head = record.offset
            elif record.kind in (_KEYFRAME, _SCENE, _FRAME):
                if record.kind != _FRAME:
                    shift += max(last - record.time - shift, 0.0) if math.isfinite(last) else 0.0
                    self._keyframes.append((record.time + shift, shift, head if record.kind == _KEYFRAME else record.offset))
                last = max(last, record.time + shift)
        self.start = self._keyframes[0][0] if self._keyframes else 0.0

    def _rewind(self, at, shift=0.0):
        self.scene._reset()
        self.head, self._decoder, self._found, self._shift = None, _Decoder(), [], shift
        self.reached = self.verified = self.gaps = self.unclosed_sessions = 0
        self.was_closed = self._ended = False
        self._lost, self._counted, self.trouble = True, False, None  # waiting for a keyframe; its gap has been counted
        self._source = _records(self._data, at, lambda *place: self._found.append(Damage(*place)))
        self._next = None

    # ---- states -----------------------------------------------------------------------------------------------------

    def step(self):
        """To the next state. False at the end. Raises Error for a record that cannot be applied, and goes on at the next whole state."""
        self._check_open()
        record = self._ahead()
        if record is None:
            self._tell()
            return False
        self._next = None
        before = self.scene.now + self._shift
        try:
            self.changes = self.scene._apply(record, self._decoder)
        except FormatError as error:
            self._lost = True
            self._tell(error.text)
            raise FormatError(error.text, self._path) from None
        if record.origin == 0 and self.reached and record.time + self._shift < before:
            self._shift = before - record.time
        self._lost = self._counted = False
        self.reached += 1
        if self.scene.hash == record.hash:
            self.verified += 1
        else:
            self._tell(f"state {record.to} has the hash {self.scene.hash}, recorded was {record.hash}")
        self.record, self.counts = record, self._decoder.counts
        if self._found or self.gaps:
            self._tell()
        return True

    def _ahead(self):
        """The record that leads to the next state, without going there; None at the end."""
        while self._next is None:
            record = next(self._source, None)
            if record is None:
                return None
            self.was_closed = record.kind == _INDEX and record.to == 0
            if record.kind == _HEAD:
                self._take_head(record)
                continue
            self._ended = self.was_closed
            if record.kind == _SCENE:
                self.head, self.scene._old_hashes = None, False
                self._next = record
            elif record.kind in (_FRAME, _KEYFRAME) and self._leads_on(record):
                self._next = record
        return self._next

    def _take_head(self, record):
        head = _Head(record.payload)
        old, self.head = self.head, head
        if old and (head.epoch, head.version) == (old.epoch, old.version):
            return
        if head.mode == 1:
            raise NoExtension(f"{self._path}: a log in input mode is run again, which needs the extension module")
        if old and head.epoch != old.epoch and self.reached and (not self._ended or head.start is not None):
            self.unclosed_sessions += 1
        self.scene._old_hashes = head.version < 3
        self._decoder.restart()
        self._lost, self._counted = True, False

    def _leads_on(self, record):
        if self.head is None:
            return False
        if not self._lost:
            if record.origin == self.scene.number and not (record.kind == _KEYFRAME and record.to == 0):
                return True
            if record.to <= self.scene.number:
                return False
            self._miss()
        if record.kind == _FRAME:
            self._miss()
        return record.kind == _KEYFRAME

    def _miss(self):
        self._lost = True
        self.gaps += not self._counted
        self._counted = True

    def _tell(self, text=""):
        """Warns once of what is not whole."""
        first = text or (f"{self._found[0].length} bytes at {self._found[0].offset} are damaged: {self._found[0].text}" if self._found else
                         "states are missing" if self.gaps else "")
        if first and not self._told:
            self._told, self.trouble = True, first
            warnings.warn(f"{self._path}: {first}", DiagnosticWarning, stacklevel=3)

    def _check_open(self):
        if self.scene.closed:
            raise Closed("the log is closed")

    @property
    def time(self):
        """Of the state, seconds since the log's start."""
        seconds = self.scene.now + self._shift - self.start
        return seconds if self.start < 1e6 else round(seconds * 1e6) / 1e6

    @property
    def at_end(self):
        """No state comes after it."""
        return self._ahead() is None

    def seek(self, seconds):
        """To the last state at or before this time since the log's start; the first one, if it is before all."""
        self._check_open()
        before = [k for k in self._keyframes if k[0] <= self.start + seconds] or self._keyframes[:1]
        self._rewind(before[-1][2], before[-1][1])
        self.step()
        while (record := self._ahead()) and record.time + self._shift - self.start <= seconds:
            self.step()

    def _seek_first(self, start):
        self.seek(start - _SAME)
        more = True
        while more and self.time < start - _SAME:
            more = self.step()
        return more

    def states(self, *, start=0.0, stop=math.inf, every=1):
        """Goes through the states from `start` to `stop` (seconds since the log's start), every one or every so many: the ChangeSet
        that led to each, with `scene` in it."""
        if every < 1:
            raise ValueError("every is 1 or more")
        number, more = 0, self._seek_first(start)
        while more and self.time <= stop + _SAME:
            if number % every == 0:
                yield self.changes
            number += 1
            more = self.step()

    def _to_end(self):
        """Steps on to the end; what cannot be applied is passed over."""
        more = True
        while more:
            try:
                more = self.step()
            except FormatError:
                continue

    # ---- what a log tells -------------------------------------------------------------------------------------------

    def table(self, *paths, start=0.0, stop=math.inf, every=1):
        """A Table of fields: "TRAIN.rotation", "DOOR.*", "#12.translation"; one row for each state, or every so many."""
        if not paths:
            raise ValueError("table() takes at least one \"NODE.field\"")
        own = type(self)(self._path)  # this log's scene stays where it is
        columns, times, shape = _Columns(own.scene, paths), [], None
        for _ in own.states(start=start, stop=stop, every=every):
            times.append(own.time)
            if shape != (own.scene._shape, own.scene._nodes[1]):
                shape = own.scene._shape, own.scene._nodes[1]
                columns.find()
            columns.add_row()
        return columns.table(times)

    def verify(self):
        """Replays all of it: a dict of states, those verified by their hash, gaps, damaged places, and the first Divergence or None."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DiagnosticWarning)
            own = type(self)(self._path)
            own._to_end()
        text = own.trouble or ("" if own.was_closed or own.head is None else "the log was not closed")
        first = Divergence(own.scene.number, own.time, "", "", text) if text else None
        return {"states": own.reached, "verified": own.verified, "gaps": own.gaps, "damaged": len(own._found), "first_divergence": first}

    @property
    def damage(self):
        """Damage by Damage: bytes that no intact record covers."""
        found = []
        for _ in _records(self._data, 0, lambda *place: found.append(Damage(*place))):
            pass
        return found

    def close(self):
        """Closes the log and its scene."""
        self.scene.closed, self._data = True, b""

    def __getattr__(self, name):
        raise NoExtension(f"Log.{name} is not in the reader in Python alone; it needs the extension module rtsg._rtsg")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class _Columns:
    """Values of chosen fields, state by state."""

    def __init__(self, scene, paths):
        self.scene, self.patterns, self.columns, self.found, self.rows = scene, [], {}, {}, 0
        for path in paths:
            node, _, field = path.rpartition(".")
            if not node or not field:
                raise NoSuchName(f"{path}: expected NODE.field", code="no-such-field")
            self.patterns.append((node, self.matcher(node), self.matcher(field)))
        self.matched = set()

    @staticmethod
    def matcher(pattern):
        return re.compile(".*".join(re.escape(part) for part in pattern.split("*")), re.DOTALL).fullmatch

    def find(self):
        """Which fields the columns are of now: after nodes have come, gone or changed their names."""
        self.found, first = {}, {}
        for n, inside in sorted(self.scene._nodes.items()):
            path, number = self.scene._scoped_name(n), f"#{n}"
            for p, (text, of_node, of_field) in enumerate(self.patterns):
                if text != number and not (path and of_node(path)) or n == 1:
                    continue
                for index, field in enumerate(inside.type.fields):
                    if field.hidden or field.access == 1 or not of_field(field.name):
                        continue
                    self.matched.add(p)
                    name = f"{number if text == number else path}.{field.name}"
                    column = self.columns.setdefault(name, (field.kind, p, [None] * self.rows))
                    if column[0] == field.kind and name not in first:
                        first[name] = self.found[name] = (n, index)

    def add_row(self):
        for name, (_, _, values) in self.columns.items():
            at = self.found.get(name)
            values.append(self.scene._raw(*at) if at else None)
        self.rows += 1

    def table(self, times):
        for p, (text, _, _) in enumerate(self.patterns):
            if p not in self.matched:
                raise NoSuchName(f"no state has a field of {text}", code="no-such-field")
        ordered = sorted(self.columns.items(), key=lambda item: item[1][1])
        made = {"time": np.array(times, float), **{name: self.array(kind, values) for name, (kind, _, values) in ordered}}
        return Table(made, {name: _type_name(kind) for name, (kind, _, _) in ordered}, {name: _component_names(kind) for name, (kind, _, _) in ordered})

    def array(self, kind, values):
        k = kind // 2
        if kind % 2 or _LAYOUT[k] is None or k == _NODE:
            array = np.empty(len(values), object)
            for i, raw in enumerate(values):
                array[i] = None if raw is None else self.label(kind, raw)
            return array
        code, shape = _LAYOUT[k]
        whole = all(raw is not None for raw in values)
        if whole or code in ("<f4", "<f8"):
            missing = np.full(shape, np.nan, code).tobytes() if not whole else b""
            return np.frombuffer(b"".join(missing if raw is None else raw for raw in values), code).reshape(len(values), *shape)
        return np.array([np.nan if raw is None else _plain(kind, raw) for raw in values], float)

    def label(self, kind, raw):
        if kind == _SFNODE:
            n = _plain(kind, raw)
            return self.scene._label(n) if n else None
        return tuple(self.scene._label(n) if n else None for n in (raw if isinstance(raw, tuple) else ())) if kind == _MFNODE else _plain(kind, raw)


def _component_names(kind):
    k = kind // 2
    count = math.prod(_LAYOUT[k][1]) if _LAYOUT[k] and not kind % 2 else 1
    if count < 2:
        return []
    if k == _ROTATION:
        return ["x", "y", "z", "angle"]
    return [str(i) if count > 4 else ("rgba" if "Color" in _NAMES[k] else "xyzw")[i] for i in range(count)]


# ---- mirrors ---------------------------------------------------------------------------------------------------------

_HELLO, _ACK, _PING, _PONG, _BYE, _SUBMIT, _CONTROL = 1, 2, 3, 4, 5, 9, 10
_WELCOME, _DATA, _UNKNOWN_CLIENT, _REFUSED, _VERDICT, _REPLY = 16, 17, 18, 19, 22, 23
_WINDOW, _SUBMIT_PART = 8 << 20, 8 << 10
_LOOK = .05  # seconds; how often what is due by the clock is looked at
_AGAIN, _AGAIN_LOST, _MOST_DOUBLINGS, _PING_EVERY, _SILENCE, _REQUEST_AGAIN = .5, 2.0, 4, .5, 2.5, 1.0  # seconds


def _message(type_, *numbers):
    return struct.pack(f"<4sBBH{len(numbers)}Q", b"RTSG", 1, type_, 0, *numbers)


def _request_record(payload, kind):
    """A record of a client; its states, time and hash mean nothing."""
    rest = struct.pack("<BBHIQQdQQ", kind, 0, len(payload) & 0xFFFF, len(payload) >> 16, 1, 1, 0, 0, 0) + payload
    return _MAGIC + xxh3_64(rest).to_bytes(8, "little") + rest


def _block(kind, body):
    return bytes([kind]) + _varint(1) + _varint(len(body)) + body


class Session:
    """What a client says and hears, by whatever carries it: `send(first, second)` is called with the parts of a message,
    receive() is to be called with what comes, tick() a few times a second."""

    def __init__(self, send, *, name="", parts=()):
        self.send, self.name, self.parts = send, name, list(parts)
        self.scene, self.decoder = Scene(), _Decoder()
        self.session, self.client = secrets.randbits(63) | 1, secrets.randbits(63) | 1
        self.epoch, self.server_hash, self.has_state, self.connected = 0, (0, 0), False, False
        self.origin_lost, self.gone, self.refusal, self.replies, self.verdicts, self.sets = False, False, "", [], [], []
        self.requests, self.next_request, self.unanswered, self.origin_state = {}, 1, 0, 0
        self.received = self.acknowledged = self.heard = self.greeted = self.pinged = self.ticked = 0
        self.partial, self.applying, self.trouble = None, False, []
        self.count = dict.fromkeys(("frames", "snapshots", "gaps", "bytes", "divergences", "restarts", "garbage"), 0)

    def hello(self, afresh=False):
        """To be called when there is a connection; asks to go on from the present state, or `afresh` for a whole one."""
        self.session = self.session + 1 & _M64
        self.received = self.acknowledged = 0
        self.partial, self.connected, self.has_state = None, False, self.has_state and not afresh
        known = self.has_state
        rest = _text(self.name[:100]) + struct.pack("<QBII", self.client, 0, 0, 0) + _varint(len(self.parts)) + b"".join(map(_text, self.parts))
        rest += struct.pack("<BIQQQ", 0, 0, 0, *(self.server_hash if known else (0, 0)))
        self.send(_message(_HELLO, self.session, 0, self.epoch if known else 0, self.scene.number if known else 0, _WINDOW) + rest, b"")
        self.unanswered += 1
        self.greeted = time.monotonic()

    def cut(self):
        """To be called when the connection is lost."""
        self.connected, self.unanswered = False, 0

    def tick(self):
        now = time.monotonic()
        if now - self.ticked > _SILENCE / 2:
            self.heard = now  # the silence may be this program's own
        self.ticked = now
        if not self.connected:
            wait = _AGAIN_LOST * 2 ** min(self.unanswered - 1, _MOST_DOUBLINGS) if self.unanswered else _AGAIN
            if now - self.greeted > wait and not self.refusal:
                self.hello()
        elif now - self.heard > _SILENCE:
            self.cut()
        else:
            if now - self.pinged > _PING_EVERY:
                self.pinged = now
                self.send(_message(_PING, time.monotonic_ns()), b"")
            for number, request in self.requests.items():
                if now - request[1] > _REQUEST_AGAIN:
                    self._send_request(number)

    def receive(self, first, second=b""):
        try:
            r = _Reader(first)
            magic, version, type_, zero = r.numbers("4sBBH")
            if (magic, zero) != (b"RTSG", 0) or (version != 1 and self.connected):
                raise FormatError("none of this protocol")
            if version != 1:  # a server of another version refuses us in words, if it knows how versions meet
                self.refusal = r.text() if type_ == _REFUSED else (
                    f"this server speaks version {version} of the protocol, and this client version 1")
                return
            self.heard = time.monotonic()
            self._take(type_, r, second)
        except FormatError as error:
            self.count["garbage"] += 1
            self.trouble.append(error.text)
            if self.applying:
                self.hello(True)  # what was half applied is no state
            self.applying = False
        if self.connected and self.received != self.acknowledged:
            self._acknowledge()

    def _take(self, type_, r, second):
        if type_ == _WELCOME:
            self._welcome(r, second)
        elif type_ == _DATA:
            self._data(r, second)
        elif type_ == _PING:
            token = r.u64()
            self.origin_state = r.u64() if r.left >= 8 else self.origin_state
            self.origin_lost = r.u64() != 0 if r.left >= 8 else self.origin_lost
            self.send(_message(_PONG, token), b"")
            if self.connected and self.has_state and self.partial is None and self.scene.number < token <= self.origin_state:
                self._gap()  # what was sent has not come
        elif type_ == _BYE:
            self.gone, self.connected, self.unanswered, self.greeted = True, False, 0, time.monotonic()
            self.send(_message(_BYE), b"")
        elif type_ == _UNKNOWN_CLIENT:
            if self.connected:
                self.hello()
        elif type_ == _REFUSED:
            self.connected, self.unanswered, self.greeted = False, 0, time.monotonic()
            self.refusal = r.text()
        elif type_ == _VERDICT:
            self._verdict(r)
        elif type_ == _REPLY:
            r.u64()
            self.replies.append(r.text())

    def _welcome(self, r, second):
        if r.u64() != self.session:
            return
        epoch, _ = r.u64(), r.u64()
        self.origin_state = r.u64() if r.left >= 8 else 0
        record = _Record(second)
        if record.kind != _HEAD:
            raise FormatError("a welcome without a head")
        head = _Head(record.payload)
        self.unanswered, self.scene._old_hashes = 0, head.version < 3
        if epoch != self.epoch:
            self.has_state, self.epoch = False, epoch
            self.requests.clear()
            self.decoder.restart()
        self.connected, self.gone, self.origin_lost = True, False, False
        self._acknowledge()
        for number in self.requests:
            self._send_request(number)

    def _acknowledge(self):
        self.send(_message(_ACK, self.session, self.scene.number if self.has_state else 0, self.received), b"")
        self.acknowledged = self.received

    def _gap(self, afresh=False):
        self.count["gaps"] += 1
        self.hello(afresh)

    def _data(self, r, part):
        session, size, offset = r.numbers("QQQ")
        if session != self.session or not self.connected:
            return
        if size > _MOST_RECORD or not part or offset + len(part) > size:
            raise FormatError(f"{len(part)} bytes from {offset} of {size}")
        self.received += len(part)
        self.count["bytes"] += len(part)
        if offset == 0:
            self.partial = bytearray()
        if self.partial is None or offset != len(self.partial):
            self.partial = None
            self._gap()
            return
        self.partial += part
        if len(self.partial) == size:
            whole, self.partial = bytes(self.partial), None
            self._record(whole)

    def _record(self, data):
        try:
            record = _Record(data)
        except FormatError as error:
            self.trouble.append(error.text)
            self._gap()
            return
        if record.kind not in (_FRAME, _KEYFRAME):
            return
        follows = self.has_state and record.origin == self.scene.number
        if not follows and record.kind != _KEYFRAME:
            if not self.has_state or record.to > self.scene.number:
                self._gap(not self.has_state)
            return
        if not follows:
            self.scene._reset()
        self.applying = True
        self.sets.append(self.scene._apply(record, self.decoder))
        self.applying, self.has_state = False, True
        self.server_hash = int(record.hash[16:], 16), int(record.hash[:16], 16)
        self.count["snapshots" if record.kind == _KEYFRAME else "frames"] += 1
        if self.scene.hash != record.hash:
            self.count["divergences"] += 1
            self.count["restarts"] += 1
            self.trouble.append(f"state {record.to} has the hash {self.scene.hash} here, {record.hash} at the origin")
            self.hello(True)

    # ---- upstream ---------------------------------------------------------------------------------------------------

    def submit(self, record):
        """Sends a record of changes or a request; returns its number."""
        number, self.next_request = self.next_request, self.next_request + 1
        self.requests[number] = [record, 0.0]
        if self.connected:
            self._send_request(number)
        return number

    def _send_request(self, number):
        record = self.requests[number][0]
        self.requests[number][1] = time.monotonic()
        for at in range(0, len(record), _SUBMIT_PART):
            self.send(_message(_SUBMIT, self.session, number, len(record), at), record[at:at + _SUBMIT_PART])

    def _verdict(self, r):
        session, request, state = r.numbers("QQQ")
        if session != self.session:
            return
        reason, created = r.text(), {}
        for _ in range(r.count(2) if r.left else 0):
            asked = r.varint()
            created[asked] = r.varint()
        if self.requests.pop(request, None):
            self.verdicts.append(Verdict(request, reason, state, created, r.text() if r.left else ""))

    def control(self, command):
        """A command to the player of a log: "pause", "seek 3" and so on."""
        self.send(_message(_CONTROL, self.session) + _text(command), b"")


class Follower(Following):
    """A scene that is served elsewhere, followed over ZeroMQ: `for changes in follower` or `async for changes in follower`."""

    def __init__(self, endpoint, *, name="", parts=()):
        try:
            import zmq
        except ImportError:
            raise NoExtension("mirrors are followed in Python alone by pyzmq (Debian: python3-zmq), which is not installed") from None
        self._zmq, self._thread = zmq, threading.get_ident()
        self._socket = zmq.Context.instance().socket(zmq.DEALER)
        self._socket.setsockopt(zmq.LINGER, 200)
        try:
            self._socket.connect(endpoint)
        except zmq.ZMQError as error:
            self._socket.close()
            raise Error(f"{endpoint}: {error}", code="mirror") from None
        self._session = Session(lambda first, second: self._socket.send_multipart([first, second] if second else [first]), name=name, parts=parts)
        self._warned, self._verdicts = 0, []
        self._session.hello()

    scene = property(lambda self: self._session.scene, doc="The replica, in the newest state that has come.")
    unanswered = property(lambda self: len(self._session.requests), doc="How many requests have no verdict yet.")
    origin_lost = property(lambda self: self._session.origin_lost, doc="The origin is out of reach.")
    server_left = property(lambda self: self._session.gone, doc="The server said goodbye.")
    _waiting = property(lambda self: ([self._here().getsockopt(self._zmq.FD)], _LOOK))  # what to wait for, and at most how long

    @property
    def in_step(self):
        """The replica is in the newest state that was heard of."""
        return self._session.has_state and self._session.scene.number >= self._session.origin_state

    @property
    def statistics(self):
        """Frames, bytes, gaps and so on, as a dict."""
        scene = self._session.scene
        return {**self._session.count, "sequence": scene.number, "origin_sequence": self._session.origin_state, "hash": scene.hash}

    def _here(self):
        if self._socket.closed:
            raise Closed("the connection is closed")
        if threading.get_ident() != self._thread:
            raise WrongThread("the follower belongs to the thread that made it; this is another one", code="wrong-thread")
        return self._socket

    def poll(self, timeout=0.0):
        """Applies what has come, after waiting for it at most `timeout` seconds: the ChangeSets, in order."""
        socket, session, end = self._here(), self._session, time.monotonic() + timeout
        while True:
            session.tick()
            socket.poll(max(0, min(50, math.ceil(1e3 * (end - time.monotonic())))))
            while socket.getsockopt(self._zmq.EVENTS) & self._zmq.POLLIN:
                parts = socket.recv_multipart(self._zmq.NOBLOCK)
                session.receive(parts[0], parts[1] if len(parts) > 1 else b"")
            for text in session.trouble[self._warned:]:
                warnings.warn(text, DiagnosticWarning, stacklevel=2)
            self._warned = len(session.trouble)
            if session.refusal:
                raise Error(f"the server refuses: {session.refusal}", code="mirror")
            self._verdicts += session.verdicts
            session.verdicts = []
            if session.sets or self._verdicts or session.gone or time.monotonic() >= end:
                sets, session.sets = session.sets, []
                return sets

    def verdicts(self):
        """What became of requests since the last call: Verdict by Verdict."""
        given, self._verdicts = self._verdicts, []
        return given

    def _field(self, path):
        name, _, field = path.rpartition(".")
        node = self.scene[name]
        inside = node._inside()
        if field not in inside.type.index:
            raise NoSuchName(f"{inside.type.name} has no field {field}", code="no-such-field")
        index = inside.type.index[field]
        return node.node_id, index, inside.type.fields[index].kind

    def _submit(self, record):
        self._here()
        return self._session.submit(record)

    def edit(self, path, value):
        """Asks the origin to set "NODE.field". Returns the request's number."""
        n, field, kind = self._field(path)
        if kind in (_SFNODE, _MFNODE):
            ids = [0 if one is None else one.node_id for one in (value if kind == _MFNODE else (value,))]
            steps = b"".join(_zigzag(a - b) for a, b in zip(ids, [n, *ids]))
            body = bytes([5 if kind == _MFNODE else 4]) + _zigzag(n) + _varint(field) + (_varint(len(ids)) if kind == _MFNODE else b"") + steps
            return self._submit(_request_record(_block(3, body), _FRAME))
        return self._submit(_request_record(_block(4, bytes([0, 1, kind]) + _varint(field) + _zigzag(n) + _wire_of(kind, value, path)), _FRAME))

    def send(self, path, value):
        """Asks the origin for an event to "NODE.field". Returns the request's number."""
        n, field, kind = self._field(path)
        if kind in (_SFNODE, _MFNODE):
            raise NoExtension("events of nodes are sent by the extension module alone")
        body = _varint(4 * n + 1) + _varint(field) + bytes([kind]) + _wire_of(kind, value, path)
        return self._submit(_request_record(_block(8, body), _FRAME))

    def undo(self):
        """Takes back what this follower did last."""
        return self._submit(_request_record(b"\x01", _REQUEST))

    def redo(self):
        """Does again what was taken back last."""
        return self._submit(_request_record(b"\x02", _REQUEST))

    def lock(self, nodes, seconds):
        """Nobody else may change these nodes for so long, 60 s at most; 0 lets go of them."""
        ids = [self.scene[name].node_id for name in nodes]
        steps = b"".join(_zigzag(a - b) for a, b in zip(ids, [0, *ids]))
        return self._submit(_request_record(b"\x03" + _varint(round(1e3 * seconds)) + _varint(len(ids)) + steps, _REQUEST))

    def control(self, command):
        """A command to the player of a log: "pause", "seek 3"; its reply is in `replies`."""
        self._here()
        self._session.control(command)

    replies = property(lambda self: self._session.replies, doc="Replies to commands, all so far.")

    def close(self):
        """Ends the connection, and stays with the last state."""
        if not self._socket.closed:
            self._here()
            self._session.send(_message(_BYE), b"")
            self._socket.close()

    def __getattr__(self, name):
        raise NoExtension(f"Follower.{name} is not in the follower in Python alone; it needs the extension module rtsg._rtsg")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def follow(endpoint, *, name="", keys="", parts=(), latency=0.0, base=""):
    """Follows a scene that is served at a ZeroMQ endpoint: a Follower. `name`: the author of what it asks for. `parts`: only
    these subtrees, or a region. What else the extension takes raises NoExtension."""
    if keys or latency or base:
        raise NoExtension("keys, latency and base need the extension module rtsg._rtsg")
    if endpoint.startswith(("nats://", "tls://")):
        raise NoExtension("what a NATS server passes on needs the extension module rtsg._rtsg")
    return Follower(endpoint, name=name, parts=parts)
