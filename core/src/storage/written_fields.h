// WrittenFields: which fields were written since the last seal, in order, with what is known of their values before.
//
// Entries lie in chunks and stay where they are, so that several writers, each in chunks of its own, may write at a
// time; pieces of chunks say in which order the entries count. An entry's slot is its number by place, not by order.
// Threading: takeChunk() and at() on any thread; all else while nobody writes.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <vector>

#include <rtsg/core/change.h>

namespace rtsg {

/// One field written since the last seal. Sealed ones are kept until the next set, because fields written in one frame
/// are likely to be written in the next, and then the term of the earlier value is known.
struct WrittenField {
    NodeId node;             // none once the node is destroyed or the term used
    std::uint32_t next = 0;  // slot + 1 of the entry of the same node before
    FieldIndex field = kNoField;
    FieldType type = FieldType::SFBool;
    bool external = true;
    bool hashed = false;      // `before` is the term of the value before, not its bytes
    TypeIndex nodeType = {};  // of those that sealed sets wrote, else none
    std::uint64_t before[2] = {};
    Hash128 term() const { return {before[0], before[1]}; }
    void setTerm(Hash128 term) {
        before[0] = term.low;
        before[1] = term.high;
        hashed = true;
    }
};
static_assert(sizeof(WrittenField) == 32 && std::is_trivially_destructible_v<WrittenField>);

class WrittenFields {
  public:
    static constexpr std::uint32_t kChunk = 1024;
    /// Entries beside each other in one chunk.
    struct Piece {
        WrittenField* begin = nullptr;
        std::uint32_t count = 0;
        std::uint32_t lane = 0;  // that wrote them: Lane::laneNumber
    };
    struct Chunk {
        WrittenField* entries = nullptr;
        std::uint32_t slot = 0;  // of the first entry
    };

    /// Room for kChunk entries that nobody else has, for the lane of this number: if possible the chunk that it had
    /// before, which is in its thread's cache. The scene's own lane, 0, gets free chunks in order.
    Chunk takeChunk(std::uint32_t lane);
    /// Precondition: there is an entry.
    WrittenField& at(std::uint32_t slot) const {
        return table_.load(std::memory_order_acquire)[slot / kChunk]->entries()[slot % kChunk];
    }
    /// The place behind the last entry of the chunk that `slot` is in, if it is there and in a piece; else null.
    WrittenField* endFor(std::uint32_t slot) const {
        if (slot / kChunk >= chunks_.size()) return nullptr;
        Memory& chunk = *table_.load(std::memory_order_relaxed)[slot / kChunk];
        return slot % kChunk < chunk.used ? chunk.entries() + chunk.used : nullptr;
    }
    /// These entries come next in order. They are the last ones so far of the chunk that `slot` is in.
    void append(Piece piece, std::uint32_t slot);
    const std::vector<Piece>& pieces() const { return pieces_; }
    std::size_t size() const { return size_; }
    /// Keeps as many chunks as were needed now.
    void clear();

  private:
    struct alignas(64) Memory {
        std::uint32_t used = 0;  // entries that are in pieces
        std::uint32_t lane = 0;  // that has it, or had it last
        bool isTaken = false;
        WrittenField* entries() { return reinterpret_cast<WrittenField*>(this + 1); }
    };
    struct Release {
        void operator()(Memory* memory) const { std::free(memory); }
    };
    void grow();
    /// The place of a free chunk for this lane; that behind the last chunk if there is to be one more.
    std::size_t findFree(std::uint32_t lane);

    std::mutex mutex_;
    std::vector<std::unique_ptr<Memory, Release>> chunks_;
    std::uint32_t taken_ = 0;          // of the chunks
    std::vector<std::size_t> looked_;  // by lane: how far it has looked for a chunk
    std::atomic<Memory**> table_{nullptr};
    std::vector<std::unique_ptr<Memory*[]>> tables_;  // the last one counts; readers may be in those before
    std::size_t room_ = 0;                            // in it
    std::vector<Piece> pieces_;
    std::size_t size_ = 0;
};

}  // namespace rtsg
