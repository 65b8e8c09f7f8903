// Terms of the state hash: one 128-bit term per node, non-default field, name and route, added modulo 2^128.
//
// A sum makes the hash incremental: a change subtracts the old term and adds the new one. A term is
// XXH3-128 of the canonical bytes, seeded with what the bytes belong to. An MFNode is the sum over neighbours in
// it, so that inserting one child among a million costs one child.
#pragma once

#include <rtsg/core/change.h>

namespace rtsg::detail {

enum class HashTerm : std::uint8_t { node = 1, field = 2, children = 3, name = 4, route = 5 };

class StateHash {
  public:
    StateHash() = default;
    explicit StateHash(Hash128 sum) : low_(sum.low), high_(sum.high) {}
    void add(Hash128 term) {
        low_ += term.low;
        high_ += term.high + (low_ < term.low ? 1 : 0);
    }
    void subtract(Hash128 term) {
        high_ -= term.high + (low_ < term.low ? 1 : 0);
        low_ -= term.low;
    }
    Hash128 value() const { return {low_, high_}; }

  private:
    std::uint64_t low_ = 0, high_ = 0;
};

/// `storage` in block representation, not the type's default (whose term is zero by definition).
Hash128 fieldTerm(NodeId node, FieldIndex field, FieldType type, const void* storage);
Hash128 childTerm(NodeId node, FieldIndex field, NodeId before, NodeId after);
Hash128 nodeTerm(NodeId node, std::uint64_t typeNameHash, NodeId scope);
Hash128 nameTerm(NodeId node, std::string_view name);
Hash128 routeTerm(NodeId from, FieldIndex fromField, NodeId to, FieldIndex toField, bool isConnection);
std::uint64_t typeNameHash(std::string_view name);

}  // namespace rtsg::detail
