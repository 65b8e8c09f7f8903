// Change codec: a ChangeSet to a record and back; wire and log use the same bytes (PROTOCOL.md, "Changes").
//
// Invariant: encoding needs nothing but the sets so far. decode(encode(x)) has the effect of x: value changes come
// grouped by (field, type, origin), every other kind keeps its order. Both sides remember the last values of a stream
// whose mode asks for a coding; where a reader may start, flags in a record say (record.h).
// Input is never trusted: every count is checked against the bytes that are there before anything is allocated, and a
// set takes at most 4 times the bytes of its record and 64 MiB, beside the values that a stream remembers (at most 2^22
// fields); encoders make records longer that would take more.
// Threading: one thread an object; objects keep buffers, so that the steady state allocates nothing.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <rtsg/core/change.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/sync/byte_buffer.h>
#include <rtsg/sync/dictionary.h>
#include <rtsg/sync/record.h>

namespace rtsg {

class OriginHash;
class TypeMapping;
namespace wire {
class ColumnReader;
struct Budget;
struct Reader;
}  // namespace wire

class ChangeEncoder {
  public:
    /// `types`: what TypeIndex numbers mean; they must outlive the encoder.
    explicit ChangeEncoder(const StreamMode& mode = {}, TypeTable types = builtinTypes());
    ~ChangeEncoder();
    /// From now on arrays of numbers are packed, and all else is deflated: fewer bytes, more time. For files.
    void makeSmall();
    /// `record` becomes a scene file's: small, and node types have the numbers of the catalogue (PROTOCOL.md) instead
    /// of descriptions. False, with nothing done, if the catalogue does not have a built-in type of the snapshot as it
    /// is.
    bool encodeScene(const ChangeSet& snapshot, ByteBuffer& record);
    /// The next frame will refer to nothing before it: needed whenever somebody starts at the state that it starts at,
    /// from a keyframe that this encoder did not write. After a keyframe of its own this happens by itself.
    void restart();
    /// `record` becomes one whole record: a keyframe if the set is a snapshot, else a frame.
    void encode(const ChangeSet& set, ByteBuffer& record);
    /// The same for frames of another encoder of this mode that were merged into one, for a reader that has all up to
    /// `set.from`. It refers to nothing; to go on from `set.to` takes a frame with kSync or kForget (record.h).
    void encodeMerged(const ChangeSet& set, ByteBuffer& record);
    /// Whether the records so far describe the types of all nodes that this set creates.
    bool describesTypesOf(const ChangeSet& set) const;

  private:
    void write(const ChangeSet& set, std::uint8_t flags, bool predicting, ByteBuffer& record);

    struct Parts;
    std::unique_ptr<Parts> parts_;
};

/// What a decoder left out because this program does not know it.
struct DecoderLosses {
    std::uint64_t blocks = 0;   // kinds of blocks and codings of a later format
    std::uint64_t changes = 0;  // of fields that this program's types do not have, or have with another type
};

class ChangeDecoder {
  public:
    /// `local`: this program's built-in types; they must outlive the decoder.
    explicit ChangeDecoder(TypeTable local);
    /// As above, with the hash of `local` when it is known already: it takes a look at every type.
    ChangeDecoder(TypeTable local, std::uint64_t localHash);
    ~ChangeDecoder();

    /// Announces the stream, or that it goes on after an interruption; without this, it has to come from the same
    /// build. Types of another build are mapped by name as they are described; one that is unknown here is defined in
    /// the scene at its first use.
    Result<> setHead(const StreamHead& head);
    /// From the next head on, counts the state hash that the writer has, where a scene here may have another: in
    /// streams of another build or of an earlier format. Costs about what applying them does.
    void countOriginHash() { counting_ = true; }
    /// After each record; nothing where a scene here has to have the record's hash itself.
    std::optional<Hash128> originHash() const;
    /// `record`: an intact frame, keyframe or scene (checkRecord); a scene needs no head. Reuses `set`'s memory. Errors
    /// name the byte, counted from the record's start; `set` is then unspecified.
    Result<> decode(std::span<const std::byte> record, ChangeSet& set);

    /// Goes on where `other` is in the same stream: predicted values refer to what came before.
    void goOnFrom(const ChangeDecoder& other);

    /// Of this program's own types.
    std::uint64_t localHash() const { return localHash_; }
    /// True while numbers are taken as they come: the state hash then has to agree with the origin's, unless that is of
    /// format 2.
    bool exact() const { return !mapping_; }
    /// The number that a field of a node, of a number here, has with the writer; kNoField where that has no such field.
    FieldIndex fieldAtWriter(NodeId node, FieldIndex field) const;
    const DecoderLosses& losses() const { return losses_; }

  private:
    wire::ColumnReader* columnsFor(const RecordHeader& header);
    void readSceneStart(wire::Reader& in);
    bool describeFromCatalogue(std::uint16_t number, wire::Budget& budget);
    Result<> describeTypesOf(const ChangeSet& set, wire::Budget& budget);
    Result<> readBlocks(wire::Reader& in, wire::ColumnReader* columns, ChangeSet& set);

    TypeTable local_;
    std::uint64_t localHash_ = 0;
    std::array<std::uint64_t, 4> stream_{};  // epoch, dictionary hash, built-in types and version of the last head
    std::unique_ptr<TypeMapping> mapping_;   // only for streams of another build
    std::unique_ptr<OriginHash> origin_;
    bool counting_ = false;
    std::unique_ptr<wire::ColumnReader> columns_;
    DecoderLosses losses_;
};

}  // namespace rtsg
