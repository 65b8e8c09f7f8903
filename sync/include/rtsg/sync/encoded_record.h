// EncodedRecord: a record that this process has encoded or received once; senders, histories and logs share it.
//
// Invariant: a SharedRecord never changes.
// Threading: none of its own; any thread may read shared records.
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
    ByteBuffer bytes;  // values in full, so any reader that is in the state before can apply it
    RecordHeader header;
    /// The same frame with predicted values, for readers that have every record since the last kForget. May be null.
    SharedRecord predicted;
    std::uint64_t published = 0;  // the server's clock, ns; 0 for records that are not a fresh frame
    /// For peers in input mode: `input` is sent in place of the frame, `runState` after it.
    SharedRecord input, runState;
};

/// Call it once the bytes are complete: it reads their header and gives back memory that they do not need.
void finishRecord(EncodedRecord& record);

/// Bytes of memory that a record holds in all its codings, with its entries in lists.
std::uint64_t memoryOf(const EncodedRecord& record);

/// One step of a scene that follows another scene. It has the record that led to the state, the change set, or both.
struct RecordStep {
    /// The record as it was received. Any reader of this program that is in the state before can apply it. Null if
    /// there was none.
    SharedRecord record;
    /// Null only if there is a record that gives new values to just the fields of the last frame.
    std::shared_ptr<const ChangeSet> set;
};

}  // namespace rtsg
