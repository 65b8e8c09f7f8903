// TypeMapping: where the types and fields of a stream of another build are in this program.
//
// Invariant: numbers of the stream never reach a scene unmapped. Keeps the type of every node, which the wire does not
// repeat. Threading: one thread an object.
#pragma once

#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

#include <rtsg/core/change.h>
#include <rtsg/sync/change_codec.h>

#include "columns/budget.h"

namespace rtsg {

class TypeMapping {
  public:
    /// `local`: this program's built-in types; they must outlive this. `originBuiltins`: how many the writer has.
    TypeMapping(TypeTable local, std::size_t originBuiltins);

    /// False when `number` is none of the writer's built-in types. Describing a type again changes nothing.
    bool describe(std::uint16_t number, const NodeType& origin);
    bool isBuiltin(std::uint32_t number) const { return number < originBuiltins_; }
    bool knows(std::uint32_t number) const { return number < types_.size() && types_[number].known; }
    /// Whether every type that was described is the same here, but for its number.
    bool sameHere() const { return same_; }
    /// Then this does, at the cost of new nodes alone.
    Result<> renumber(ChangeSet& set) const;
    /// The writer's number of a field that has this one here; kNoField where it has none.
    FieldIndex fieldAtOrigin(NodeId node, FieldIndex field) const;
    /// Rewrites a decoded set; counts what has no counterpart here. What it adds is charged.
    Result<> toLocal(ChangeSet& set, wire::Budget& budget, DecoderLosses& losses);

  private:
    static constexpr std::uint16_t kNowhere = 0xFFFF;
    struct Type {
        bool known = false;              // described, or defined by the scene
        std::uint16_t local = kNowhere;  // kNowhere: unknown here and not yet defined in the scene
        bool identity = false;
        std::shared_ptr<const NodeType> definition;          // of those unknown here
        std::vector<FieldIndex> fields;                      // to local ones; kNoField: not here
        std::vector<std::pair<FieldIndex, Value>> defaults;  // that differ here
    };

    void restart();
    void defineHere(Type& type, std::shared_ptr<const NodeType> definition, bool external, ChangeSet& set);
    void mapAuthors(ChangeSet& set) const;
    bool mapField(NodeId node, FieldIndex& field, DecoderLosses& losses) const;

    TypeTable local_;
    std::vector<Type> types_;  // by the origin's index
    std::size_t originBuiltins_ = 0;
    bool same_ = true;
    std::uint16_t nextLocal_ = 0, rootType_ = kNowhere;
    std::unordered_map<std::uint32_t, std::uint16_t> typeOfNode_;
    std::vector<Change> defined_;
};

/// A change of `kind` with nothing else filled in.
inline Change blankChange(ChangeKind kind, NodeId node, FieldIndex field, bool external) {
    Change change;
    change.node = node;
    change.field = field;
    change.kind = kind;
    change.external = external;
    return change;
}

}  // namespace rtsg
