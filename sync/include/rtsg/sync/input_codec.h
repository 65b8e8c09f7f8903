// Input codec: what came into a frame (core's FrameInput) to an input record and back (PROTOCOL.md, "Input").
//
// A stream in input mode is: a keyframe, its run state, then one input record a frame. A frame whose input is not
// complete travels as a frame of changes, followed by its run state. Invariant: decode(encode(x)) runs to the same
// state as x. Input is never trusted: every count is checked against the bytes that are there.
// Threading: one thread an object.
#pragma once

#include <memory>
#include <span>

#include <rtsg/core/change.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/sync/byte_buffer.h>
#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/record.h>

namespace rtsg {

/// True if the set's changes must travel, followed by its run state: snapshots, frames whose input is not complete.
bool needsState(const ChangeSet& set);

class InputEncoder {
  public:
    InputEncoder();
    ~InputEncoder();
    /// The frame as an input record. Precondition: !needsState(set).
    void encode(const ChangeSet& set, ByteBuffer& record);
    /// What a scene in the state `set` leads to runs on from. Fails if `set` does not carry it: it was merged, or the
    /// scene does not record its inputs. What follows refers to nothing before it.
    Result<> encodeRunState(const ChangeSet& set, ByteBuffer& record);

  private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

class InputDecoder {
  public:
    InputDecoder();
    ~InputDecoder();
    /// Fails for a stream of another build's node types: its cascade cannot be run here.
    Result<> setHead(const StreamHead& head);
    /// `record`: an intact input record (checkRecord). The set has an input and no changes; a run state has from == to.
    Result<> decode(std::span<const std::byte> record, ChangeSet& set);

  private:
    Result<> decodeEdits(std::span<const std::byte> blocks, FrameInput& input, ChangeSet& set);

    ChangeDecoder changes_;
    ByteBuffer scratch_;
};

}  // namespace rtsg
