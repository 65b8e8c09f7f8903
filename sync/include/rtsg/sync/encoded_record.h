// EncodedRecord: a record that was encoded, or came, once in this process, and is shared by all who send, keep or log
// it.
//
// Invariant: a SharedRecord does not change any more. Threading: none of its own; shared records may be read by any
// thread.
#pragma once

#include <cstdint>
#include <memory>

#include <rtsg/core/change.h>
#include <rtsg/sync/byte_buffer.h>
#include <rtsg/sync/record.h>

namespace rtsg {

struct EncodedRecord;
using SharedRecord = std::shared_ptr<const EncodedRecord>;

struct EncodedRecord {
    ByteBuffer bytes;  // values as they are, so that any reader in the state before can take it
    RecordHeader header;
    /// The same frame with predicted values, for those who have all since the last one with kForget; or null.
    SharedRecord predicted;
    std::uint64_t published = 0;  // on the server's clock, ns; 0: not a frame that has just happened
    /// For peers in input mode: what came into the frame, to be sent in its place; how things go on, to be sent after
    /// it.
    SharedRecord input, runState;
};

/// Its bytes are there: reads their header, and gives back room that they do not need.
void finishRecord(EncodedRecord& record);

/// Bytes of memory that a record holds, in all its codings, its places in lists included.
std::uint64_t memoryOf(const EncodedRecord& record);

/// One step of a scene that follows another: the record that led to the state, the set that it holds, or both.
struct RecordStep {
    /// As it came; any reader of this program that is in the state before can take it. Null: it came otherwise.
    SharedRecord record;
    /// Null only where there is a record, and it does nothing but give fields anew what the last one gave them.
    std::shared_ptr<const ChangeSet> set;
};

}  // namespace rtsg
