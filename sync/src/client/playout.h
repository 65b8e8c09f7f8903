// MirrorPlayout: what a client has received and not applied yet, in order. Frames are held until they are due.
//
// Invariant: an item never overtakes another.
// Threading: the replica's thread.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/sync/change_codec.h>

namespace rtsg {

/// Interpolates linearly between two values of one type; rotations take the shorter arc. Other types jump at the end.
Value interpolate(const Value& from, const Value& to, double fraction);

class MirrorPlayout {
  public:
    struct Item {
        std::vector<std::byte> bytes;  // a record, or a message with its prologue
        bool isRecord = true;
        std::uint64_t due = 0;        // ns on our clock; 0: as soon as it is the first
        std::uint64_t published = 0;  // on the server's clock
    };
    void push(Item item);
    bool empty() const { return items_.empty(); }
    std::uint64_t bytes() const { return bytes_; }
    const Item& front() const { return items_.front(); }
    Item pop();
    void clear();

    /// The value that the first waiting frame gives the field. Null if the frame does not change it.
    const Value* next(ChangeDecoder& decoder, NodeId node, FieldIndex field) const;

  private:
    std::deque<Item> items_;
    std::uint64_t bytes_ = 0;
    mutable bool peeked_ = false;
    mutable ChangeSet peek_;
    mutable std::unordered_map<std::uint64_t, std::size_t> index_;
};

}  // namespace rtsg
