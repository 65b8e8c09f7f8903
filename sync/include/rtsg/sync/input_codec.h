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
    /// `types` are the scene's built-in types and must outlive the encoder.
    explicit InputEncoder(TypeTable types = builtinTypes());
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
    /// `states` decodes the states of the same stream, in which inputs have their places. It must outlive this. Without
    /// it the stream must come from the same build.
    explicit InputDecoder(const ChangeDecoder* states = nullptr);
    ~InputDecoder();
    /// `record` must be an intact input record (checkRecord). The set has an input and no changes; a run state has from
    /// == to. Types of another build are mapped by name. Error: among others, the input needs a type or a field that
    /// this program lacks, which the error names.
    Result<> decode(std::span<const std::byte> record, ChangeSet& set);

  private:
    Result<> decodeEdits(std::span<const std::byte> blocks, FrameInput& input, ChangeSet& set);

    const ChangeDecoder* states_ = nullptr;
    ChangeDecoder changes_;
    ByteBuffer scratch_;
};

}  // namespace rtsg
