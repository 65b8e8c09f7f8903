// Reader: reads the primitives of PROTOCOL.md (numbers, varints, strings and values) from untrusted bytes.
//
// Invariant: it never reads outside [begin, end). After the first problem everything reads as zero; `problem` says what
// happened and `problemAt` where. Loops over counts must stop on `problem`. With a budget, memory is charged before it
// is allocated.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/node_type.h>
#include <rtsg/core/value.h>
#include <rtsg/sync/byte_buffer.h>

#include "budget.h"

namespace rtsg::wire {

inline std::uint64_t zigzag(std::uint32_t value, std::uint32_t previous) {
    const std::int64_t delta = std::int64_t{value} - std::int64_t{previous};
    return static_cast<std::uint64_t>(delta) << 1 ^ static_cast<std::uint64_t>(delta >> 63);
}

struct Reader {
    explicit Reader(std::span<const std::byte> bytes, std::size_t offset = 0)
        : begin(bytes.data()), at(begin), end(begin + bytes.size()), base(offset) {}

    const std::byte *begin, *at, *end;
    std::size_t base;  // offset of `begin`, for messages
    const char* problem = nullptr;
    std::size_t problemAt = 0;
    Budget* budget = nullptr;

    /// Returns false, and sets a problem, if the record may take no more memory.
    bool charge(std::uint64_t bytes) {
        if (!budget || budget->take(bytes)) return true;
        refuse("takes more memory than a record of this length may");
        return false;
    }
    std::size_t left() const { return static_cast<std::size_t>(end - at); }
    std::size_t offset() const { return base + static_cast<std::size_t>(at - begin); }
    void refuse(const char* text) {
        if (!problem) {
            problem = text;
            problemAt = offset();
        }
        at = end;
    }
    template <class T>
    T number() {
        T result{};
        if (left() < sizeof(T)) {
            refuse("number cut short");
            return result;
        }
        std::memcpy(&result, at, sizeof(T));
        at += sizeof(T);
        return result;
    }
    std::uint64_t varint() {
        if (at < end && std::to_integer<unsigned>(*at) < 0x80) return std::to_integer<std::uint64_t>(*at++);
        return longVarint();
    }
    std::uint64_t longVarint() {
        std::uint64_t result = 0;
        for (int shift = 0; shift < 64; shift += 7) {
            if (at == end) {
                refuse("number cut short");
                return 0;
            }
            const auto byte = std::to_integer<std::uint64_t>(*at++);
            if (shift == 63 && byte > 1) break;
            result |= (byte & 0x7F) << shift;
            if (byte < 0x80) return result;
        }
        refuse("number too large");
        return 0;
    }
    std::uint32_t varint32() { return static_cast<std::uint32_t>(bounded(0xFFFFFFFF)); }
    std::uint64_t bounded(std::uint64_t maximum) {
        const std::uint64_t result = varint();
        if (result <= maximum) return result;
        refuse("number out of range");
        return 0;
    }
    /// Undoes zigzag(); refuses results outside 32 bits.
    std::uint32_t delta(std::uint64_t coded, std::uint32_t previous) {
        if (coded <= std::uint64_t{0x1FFFFFFFF}) {  // check before adding, because a forged step could overflow
            const auto step = static_cast<std::int64_t>(coded >> 1 ^ (~(coded & 1) + 1));
            const std::int64_t result = std::int64_t{previous} + step;
            if (result >= 0 && result <= 0xFFFFFFFF) return static_cast<std::uint32_t>(result);
        }
        refuse("node number out of range");
        return 0;
    }
    std::uint32_t delta(std::uint32_t previous) { return delta(varint(), previous); }
    /// Reads a count of things that take at least `smallest` bytes each.
    std::size_t count(std::size_t smallest) {
        const std::uint64_t result = varint();
        if (result <= left() / smallest) return result;
        refuse("count exceeds the bytes that follow");
        return 0;
    }
    std::string_view text() {
        const std::size_t length = count(1);
        const std::string_view result(reinterpret_cast<const char*>(at), length);
        at += length;
        return result;
    }
    /// Takes the next `length` bytes as a reader of their own.
    Reader part(std::size_t length) {
        if (length > left()) {
            refuse("length exceeds the bytes that follow");
            length = 0;
        }
        Reader result({at, length}, offset());
        result.budget = budget;
        at += length;
        return result;
    }
};

/// True for types whose values have one size on the wire, `info(type).elementSize`.
inline bool fixedSize(FieldType type) {
    return !isMF(type) && !info(type).shared;
}

/// Number of bytes that ByteBuffer::putVarint writes.
inline std::size_t varintSize(std::uint64_t number) {
    std::size_t size = 1;
    while (number >>= 7) ++size;
    return size;
}

void putText(ByteBuffer& out, std::string_view text);
void putTexts(ByteBuffer& out, const std::vector<std::string>& texts);
void putValue(ByteBuffer& out, const Value& value);
void putType(ByteBuffer& out, const NodeType& type);

FieldType readFieldType(Reader& in);
String readString(Reader& in);
Value readValue(Reader& in, FieldType type);
/// Returns null after a problem.
std::unique_ptr<NodeType> readType(Reader& in);

Diagnostic describe(const Reader& in, std::string_view what);

}  // namespace rtsg::wire
