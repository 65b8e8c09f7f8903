// Counts the memory that encoded records hold, and trims it.
#include <rtsg/sync/encoded_record.h>

namespace rtsg {

namespace {

// The record, its entries in lists, its reference count, and the allocator's overhead for all of them.
// overhead.
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
