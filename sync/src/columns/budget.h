// Budget: bounds the memory of a decoded record to kFactor times its length and kFree (PROTOCOL.md, "Memory").
//
// Invariant: readers charge memory before they allocate it, and refuse more. Writers count the same charges and
// lengthen records that would be refused. A charge is the most that the allocator takes (tests/sync/codec/memory_test).
// Threading: one thread an object.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include <rtsg/core/array.h>
#include <rtsg/core/change.h>
#include <rtsg/sync/byte_buffer.h>

namespace rtsg::wire {

/// The header of an array or string in block storage.
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

// Charges in bytes.
constexpr std::uint64_t kChangeCost = sizeof(Change);
constexpr std::uint64_t kArrayCost = 64;   // for an array that is not empty, beside its elements
constexpr std::uint64_t kTextCost = 56;    // for a text of a type's description, beside its bytes
constexpr std::uint64_t kTypeCost = 1024;  // beside its fields and texts
constexpr std::uint64_t kFieldCost = 512;  // of a type, beside its texts and its default

/// The charge for decoding a value, beside its change.
std::uint64_t costOf(const Value& value);
std::uint64_t costOf(const NodeType& type);
/// Lengthens an unsealed record if a reader would refuse it, because decoding it charges `cost`.
void fillUp(ByteBuffer& record, std::uint64_t cost);

}  // namespace rtsg::wire
