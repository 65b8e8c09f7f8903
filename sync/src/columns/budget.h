// What a record may become in memory: at most kFactor times its length and kFree (PROTOCOL.md, "Memory").
//
// Invariant: readers charge before they take memory, and refuse what goes beyond; writers count the same and make
// records longer that would be refused. The charges are what the allocator takes at most
// (tests/sync/codec/memory_test). Threading: one thread an object.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include <rtsg/core/array.h>
#include <rtsg/core/change.h>
#include <rtsg/sync/byte_buffer.h>

namespace rtsg::wire {

/// Of an array or string in block representation.
inline const detail::ArrayHeader* headerOf(const void* storage) {
    const detail::ArrayHeader* header = nullptr;
    std::memcpy(&header, storage, sizeof(header));
    return header;
}

struct Budget {
    static constexpr std::uint64_t kFactor = 4, kFree = std::uint64_t{64} << 20;

    explicit Budget(std::uint64_t recordSize) : left(kFactor * recordSize + kFree) {}
    bool take(std::uint64_t bytes) {
        if (bytes > left) return false;
        left -= bytes;
        return true;
    }
    std::uint64_t left;
};

// Charges, bytes.
constexpr std::uint64_t kChangeCost = sizeof(Change);
constexpr std::uint64_t kArrayCost = 64;   // one that is not empty, beside its elements
constexpr std::uint64_t kTextCost = 56;    // of a type's description, beside its bytes
constexpr std::uint64_t kTypeCost = 1024;  // beside its fields and texts
constexpr std::uint64_t kFieldCost = 512;  // of a type, beside its texts and its default

/// What decoding a value charges beside its change.
std::uint64_t costOf(const Value& value);
std::uint64_t costOf(const NodeType& type);
/// Lengthens a record (header not sealed yet) whose decoding charges `cost`, if a reader would refuse it.
void fillUp(ByteBuffer& record, std::uint64_t cost);

}  // namespace rtsg::wire
