// What encoded records hold of memory, and how little they need.
#include <rtsg/sync/encoded_record.h>

namespace rtsg {

namespace {

// Its places in lists, the block that counts its references, and what the allocator adds to each of the three.
constexpr std::uint64_t kRecordCost = sizeof(EncodedRecord) + 176;

}  // namespace

void finishRecord(EncodedRecord& record) {
    record.header = *parseRecordHeader(record.bytes.bytes());
    record.bytes.fit();
}

std::uint64_t memoryOf(const EncodedRecord& record) {
    std::uint64_t result = record.bytes.capacity() + kRecordCost;
    for (const SharedRecord* other : {&record.predicted, &record.input, &record.runState})
        if (*other) result += (*other)->bytes.capacity() + kRecordCost;
    return result;
}

}  // namespace rtsg
