// TypeMapping: maps the types and fields of a stream of another build to those of this program.
//
// Invariant: no number of the stream reaches a scene unmapped. It keeps the type of every node, which the wire does not
// repeat.
// Threading: one thread an object.
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
    /// `local` are this program's built-in types and must outlive this. `originBuiltins` is the writer's number of
    /// built-in types.
    TypeMapping(TypeTable local, std::size_t originBuiltins);

    /// Returns false if `number` is not one of the writer's built-in types. Describing a type again has no effect.
    bool describe(std::uint16_t number, const NodeType& origin);
    bool isBuiltin(std::uint32_t number) const { return number < originBuiltins_; }
    bool knows(std::uint32_t number) const { return number < types_.size() && types_[number].known; }
    /// True if every described type is the same here, apart from its number.
    bool sameHere() const { return same_; }
    /// If sameHere(), call this instead of toLocal(). It costs work for new nodes only.
    Result<> renumber(ChangeSet& set) const;
    /// The writer's number of a field whose number here is `field`. kNoField if the writer lacks it.
    FieldIndex fieldAtOrigin(NodeId node, FieldIndex field) const;
    /// Rewrites a decoded set, and counts parts that have no counterpart here. Changes that it adds are charged.
    Result<> toLocal(ChangeSet& set, wire::Budget& budget, DecoderLosses& losses);

  private:
    static constexpr std::uint16_t kNowhere = 0xFFFF;
    struct Type {
        bool known = false;              // described, or defined by the scene
        std::uint16_t local = kNowhere;  // kNowhere: unknown here and not yet defined in the scene
        bool identity = false;
        std::shared_ptr<const NodeType> definition;          // of types that are unknown here
        std::vector<FieldIndex> fields;                      // local field numbers; kNoField if there is none
        std::vector<std::pair<FieldIndex, Value>> defaults;  // defaults that differ here
    };

    void restart();
    void defineHere(Type& type, std::shared_ptr<const NodeType> definition, bool external, ChangeSet& set);
    void mapAuthors(ChangeSet& set) const;
    bool mapField(NodeId node, FieldIndex& field, DecoderLosses& losses) const;

    TypeTable local_;
    std::vector<Type> types_;  // by the origin's type index
    std::size_t originBuiltins_ = 0;
    bool same_ = true;
    std::uint16_t nextLocal_ = 0, rootType_ = kNowhere;
    std::unordered_map<std::uint32_t, std::uint16_t> typeOfNode_;
    std::vector<Change> defined_;
};

/// Returns a change of `kind` with nothing else filled in.
inline Change blankChange(ChangeKind kind, NodeId node, FieldIndex field, bool external) {
    Change change;
    change.node = node;
    change.field = field;
    change.kind = kind;
    change.external = external;
    return change;
}

}  // namespace rtsg
