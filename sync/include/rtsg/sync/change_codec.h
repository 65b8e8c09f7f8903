// Change codec: turns a ChangeSet into a record and back. Wire and log use the same bytes (PROTOCOL.md, "Changes").
//
// Invariant: the encoder needs only the sets that it has encoded so far. decode(encode(x)) has the effect of x: value
// changes come back grouped by (field, type, origin), all other kinds keep their order. If the stream's mode asks for a
// coding, both sides remember the last values; flags in a record say where a reader may start (record.h). Input is
// never trusted: every count is checked against the bytes that are there before memory is allocated. A decoded set
// takes at most 4 times the bytes of its record and 64 MiB; the stream remembers at most 2^22 fields beside that.
// Encoders pad records whose sets would take more.
// Threading: one thread an object. Objects keep their buffers, so the steady state allocates nothing.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
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
    /// `types` gives the meaning of TypeIndex numbers and must outlive the encoder.
    explicit ChangeEncoder(const StreamMode& mode = {}, TypeTable types = builtinTypes());
    ~ChangeEncoder();
    /// From now on arrays of numbers are packed and everything else is deflated. This saves bytes and costs time; it is
    /// meant for files.
    void makeSmall();
    /// `record` becomes the record of a scene file: small, and with the catalogue's numbers for node types instead of
    /// descriptions (PROTOCOL.md). Returns false, and does nothing, if the catalogue lacks the present form of a
    /// built-in type of the snapshot.
    bool encodeScene(const ChangeSet& snapshot, ByteBuffer& record);
    /// The next frame will not refer to earlier ones. Call it when a reader starts at the next frame's first state from
    /// a keyframe that this encoder did not write. After a keyframe of its own the encoder does this by itself.
    void restart();
    /// `record` becomes one whole record: a keyframe if the set is a snapshot, else a frame.
    void encode(const ChangeSet& set, ByteBuffer& record);
    /// Encodes a set that was merged from frames of another encoder of this mode, for a reader that has everything up
    /// to `set.from`. The record refers to nothing. The next record after it must have kSync or kForget (record.h).
    void encodeMerged(const ChangeSet& set, ByteBuffer& record);
    /// True if the records so far describe the types of all nodes that this set creates.
    bool describesTypesOf(const ChangeSet& set) const;

  private:
    void write(const ChangeSet& set, std::uint8_t flags, bool predicting, ByteBuffer& record);

    struct Parts;
    std::unique_ptr<Parts> parts_;
};

/// Counts what a decoder left out because this program does not know it.
struct DecoderLosses {
    std::uint64_t blocks = 0;   // kinds of blocks and codings of a later format
    std::uint64_t changes = 0;  // changes of fields that this program's types lack, or have with another type
};

class ChangeDecoder {
  public:
    /// `local` are this program's built-in types; they must outlive the decoder.
    explicit ChangeDecoder(TypeTable local);
    /// As above, for callers that know the hash of `local` already: computing it visits every type.
    ChangeDecoder(TypeTable local, std::uint64_t localHash);
    ~ChangeDecoder();

    /// Announces a stream, or that it goes on after an interruption. Without a head the stream must come from the same
    /// build. Types of another build are mapped by name as they are described; a type that is unknown here is defined
    /// in the scene at its first use.
    Result<> setHead(const StreamHead& head);
    /// From the next head on, the decoder computes the writer's state hash where the scene here may have another one:
    /// in streams of another build or of an earlier format. This costs about as much as applying the changes.
    void countOriginHash() { counting_ = true; }
    /// The writer's state hash after the last record. Empty if a scene here must have the record's hash itself.
    std::optional<Hash128> originHash() const;
    /// Takes a frame into originHash() that a scene here has computed from the stream's input, in the numbers here.
    void countRun(const ChangeSet& set);
    /// Says whether records are refused that need a type or field which this program lacks. If not, such fields are
    /// left out, and such types are defined.
    void refuseUnknown(bool on) { refusing_ = on; }
    /// `record` must be an intact frame, keyframe or scene (checkRecord); a scene needs no head. Reuses the memory of
    /// `set`. Errors name the byte, counted from the record's start; `set` is then unspecified.
    Result<> decode(std::span<const std::byte> record, ChangeSet& set);

    /// Takes over the decoding state of `other` in the same stream, because predicted values refer to earlier ones.
    void goOnFrom(const ChangeDecoder& other);

    /// The dictionary hash of this program's own types.
    std::uint64_t localHash() const { return localHash_; }
    /// True while type and field numbers need no mapping. The scene's hash must then be the origin's, unless the stream
    /// is of format 2.
    bool exact() const { return !mapping_; }
    /// The number that the writer has for a field of a node; `field` is the number here. kNoField if the writer has no
    /// such field.
    FieldIndex fieldAtWriter(NodeId node, FieldIndex field) const;
    const DecoderLosses& losses() const { return losses_; }
    /// Names fields that the writer's types have, as far as they are described, and this program's lack: "Box.solid".
    /// Empty if there are none.
    std::string lackingHere() const;

  private:
    friend class InputDecoder;
    wire::ColumnReader* columnsFor(const RecordHeader& header);
    void readSceneStart(wire::Reader& in);
    bool describeFromCatalogue(std::uint16_t number, wire::Budget& budget);
    Result<> describeTypesOf(const ChangeSet& set, wire::Budget& budget);
    Result<> readBlocks(wire::Reader& in, wire::ColumnReader* columns, ChangeSet& set);

    TypeTable local_;
    std::uint64_t localHash_ = 0;
    std::array<std::uint64_t, 4> stream_{};  // epoch, dictionary hash, built-in types and version of the last head
    std::shared_ptr<TypeMapping> mapping_;   // only for streams of another build; the inputs' decoder has it, too
    std::unique_ptr<OriginHash> origin_;
    bool counting_ = false, refusing_ = false;
    std::unique_ptr<wire::ColumnReader> columns_;
    DecoderLosses losses_;
};

}  // namespace rtsg
