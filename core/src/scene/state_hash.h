// Terms of the state hash: one 128-bit term per node, non-default field, name and route, added modulo 2^128.
//
// A sum makes the hash incremental: a change subtracts the old term and adds the new one. A term is
// XXH3-128 of the canonical bytes, seeded with what the bytes belong to. An MFNode is the sum over neighbours in
// it, so that inserting one child among a million costs one child.
#pragma once

#include <rtsg/core/hash_terms.h>

namespace rtsg::detail {

class StateHash {
  public:
    StateHash() = default;
    explicit StateHash(Hash128 sum) : sum_(whole(sum)) {}
    void add(Hash128 term) { sum_ += whole(term); }
    void subtract(Hash128 term) { sum_ -= whole(term); }
    void replace(Hash128 before, Hash128 after) { sum_ += whole(after) - whole(before); }
    Hash128 value() const { return {static_cast<std::uint64_t>(sum_), static_cast<std::uint64_t>(sum_ >> 64)}; }

  private:
    // Two numbers of 64 bits, with the carry by hand, are what compilers put into memory instead of registers.
    __extension__ using UInt128 = unsigned __int128;
    static UInt128 whole(Hash128 term) { return UInt128{term.high} << 64 | term.low; }
    UInt128 sum_ = 0;
};

/// The amount by which many terms change a hash. A StateHash is two numbers with a carry between them at every step;
/// here carries are counted apart, which takes half as many instructions in a long loop.
class TermSum {
  public:
    void add(Hash128 term) {
        low_ += term.low;
        carries_ += low_ < term.low ? 1u : 0u;
        high_ += term.high;
    }
    void subtract(Hash128 term) {
        carries_ -= low_ < term.low ? 1u : 0u;
        low_ -= term.low;
        high_ -= term.high;
    }
    Hash128 value() const { return {low_, high_ + carries_}; }

  private:
    std::uint64_t low_ = 0, high_ = 0, carries_ = 0;
};

/// The keys of all fields of a type, in their order.
std::vector<FieldKey> fieldKeys(const NodeType& type);
/// The same for built-in types, made once.
const FieldKey* builtinFieldKeys(TypeIndex type);

/// `storage` in block representation, not the type's default (whose term is zero by definition).
Hash128 fieldTerm(NodeId node, FieldKey field, FieldType type, const void* storage);
Hash128 childTerm(NodeId node, FieldKey field, NodeId before, NodeId after);
Hash128 nodeTerm(NodeId node, std::uint64_t typeNameHash, NodeId scope);
Hash128 nameTerm(NodeId node, std::string_view name);
Hash128 routeTerm(NodeId from, FieldKey fromField, NodeId to, FieldKey toField, bool isConnection);

}  // namespace rtsg::detail
