// OriginHash: computes the state hash of a stream as its writer does, with the writer's node types and version of the
// hash.
//
// Invariant: value() is the hash of the last record followed, if the stream is as it was written. So every later
// program can check a log, whatever fields, types and defaults it has itself. A set costs as much as for a scene.
// Threading: one thread an object. Source: PROTOCOL.md, "State hash".
#pragma once

#include <map>
#include <memory>
#include <unordered_map>
#include <vector>

#include <rtsg/core/change.h>
#include <rtsg/core/hash_terms.h>
#include <rtsg/sync/dictionary.h>

namespace rtsg {

class OriginHash {
  public:
    /// `own` are the writer's built-in types. It is empty if describe() gives them.
    OriginHash(const StreamHead& head, TypeTable own);

    void describe(std::uint16_t number, std::shared_ptr<const NodeType> type);
    /// Call it with each set in turn, as decoded, with the stream's numbers. Changes that make no sense are skipped.
    void follow(const ChangeSet& set);
    Hash128 value() const { return sum_; }

  private:
    struct Type {
        std::shared_ptr<const NodeType> type;
        std::vector<FieldKey> keys;
        std::uint64_t name = 0;
    };
    struct Field {
        Hash128 term;
        std::vector<NodeId> children;
    };
    struct Node {
        std::uint16_t type = 0;
        Hash128 own, name;
        std::map<FieldIndex, Field> fields;  // only fields that differ from their defaults
    };

    void restart();
    void define(std::size_t number, std::shared_ptr<const NodeType> type);
    void create(const Change& change);
    void setField(Node& node, const Change& change);
    void changeChildren(Node& node, const Change& change);
    void setName(Node& node, const Change& change);
    void changeRoute(const Node& from, const Change& change);
    void destroy(NodeId id);

    const FieldDef* fieldOf(const Node& node, FieldIndex field) const;
    std::uint64_t seed(NodeId node, const Type* type, FieldIndex field, HashTerm term) const;
    Hash128 listTerm(NodeId node, const Type& type, FieldIndex field, const std::vector<NodeId>& children) const;
    void replace(Hash128& term, Hash128 by);

    const bool byNumber_;  // format 2: terms contain a field's number instead of its name
    const std::size_t builtins_;
    std::vector<Type> types_;  // by the stream's type numbers
    std::uint16_t rootType_ = 0xFFFF;
    std::unordered_map<std::uint32_t, Node> nodes_;
    Hash128 sum_;
};

}  // namespace rtsg
