// Input codec: turns the input of a frame (core's FrameInput) into an input record and back (PROTOCOL.md, "Input").
//
// A stream in input mode has a keyframe, its run state, and then one input record a frame. A frame whose input is not
// complete is sent as changes, followed by its run state.
// Invariant: running decode(encode(x)) leads to the same state as running x. Input is never trusted: every count is
// checked against the bytes that are there.
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

/// True if a set must be sent as changes, followed by its run state: snapshots, and frames whose input is not complete.
bool needsState(const ChangeSet& set);

class InputEncoder {
  public:
    InputEncoder();
    ~InputEncoder();
    /// Encodes the frame as an input record. Precondition: !needsState(set).
    void encode(const ChangeSet& set, ByteBuffer& record);
    /// Encodes what a scene needs, besides the state that `set` leads to, to run on from there. The next record refers
    /// to nothing before it. Error: `set` has no run state, because it was merged or the scene does not record its
    /// inputs.
    Result<> encodeRunState(const ChangeSet& set, ByteBuffer& record);

  private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

class InputDecoder {
  public:
    InputDecoder();
    ~InputDecoder();
    /// Error: the stream has another build's node types, so its cascade cannot be run here.
    Result<> setHead(const StreamHead& head);
    /// `record` must be an intact input record (checkRecord). The set has an input and no changes; a run state has from
    /// == to.
    Result<> decode(std::span<const std::byte> record, ChangeSet& set);

  private:
    Result<> decodeEdits(std::span<const std::byte> blocks, FrameInput& input, ChangeSet& set);

    ChangeDecoder changes_;
    ByteBuffer scratch_;
};

}  // namespace rtsg
