// TypeMapping: maps the types and fields of a stream of another build to those of this program.
//
// Invariant: no number of the stream reaches a scene unmapped. It keeps the type of every node, which the wire does not
// repeat.
// Threading: one thread an object.
#pragma once

#include <memory>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <rtsg/core/change.h>
#include <rtsg/core/frame_input.h>
#include <rtsg/sync/change_codec.h>

#include "columns/budget.h"

namespace rtsg {

class TypeMapping {
  public:
    /// `local` are this program's built-in types and must outlive this. `originBuiltins` is the writer's number of
    /// built-in types.
    TypeMapping(TypeTable local, std::size_t originBuiltins);

    /// Returns false if `number` is not one of the writer's built-in types. Describing a type again has no effect.
    bool describe(std::uint16_t number, std::shared_ptr<const NodeType> described);
    /// One of the writer's built-in types. Precondition: it has been described.
    const std::shared_ptr<const NodeType>& description(std::uint32_t number) const {
        return types_[number].description;
    }
    bool isBuiltin(std::uint32_t number) const { return number < originBuiltins_; }
    bool knows(std::uint32_t number) const { return number < types_.size() && types_[number].known; }
    /// True if every described type is the same here, apart from its number.
    bool sameHere() const { return same_; }
    /// If sameHere(), call this instead of toLocal(). It costs work for new nodes only.
    Result<> renumber(ChangeSet& set) const;
    /// The writer's number of a field whose number here is `field`. kNoField if the writer lacks it.
    FieldIndex fieldAtOrigin(NodeId node, FieldIndex field) const;
    /// Rewrites a decoded set, and counts parts that have no counterpart here. Changes that it adds are charged.
    /// Without `losses`, what has no counterpart is an error, and so is a node of an unknown type. The input of a frame
    /// may come before its changes: both may define the same types.
    Result<> toLocal(ChangeSet& set, wire::Budget& budget, DecoderLosses* losses);
    /// Rewrites what the input of a frame has beside edits and events, which come before. `state` is that of a run
    /// state, else null. Behaviours of types that have not been described wait until they are. Error: as above.
    Result<> toLocal(FrameInput& input, RunState* state);
    /// The changes that a scene here made, in the stream's numbers. Fields that the writer lacks are left out.
    ChangeSet toOrigin(const ChangeSet& set) const;
    /// ChangeDecoder::lackingHere().
    std::string lackingHere() const;

  private:
    static constexpr std::uint16_t kNowhere = 0xFFFF;
    struct Type {
        bool known = false;              // described, or defined by the scene
        std::uint16_t local = kNowhere;  // kNowhere: unknown here and not yet defined in the scene
        bool identity = false;
        std::shared_ptr<const NodeType> description;              // as the writer has it
        std::shared_ptr<const NodeType> definition;               // of types that are unknown here
        std::vector<FieldIndex> fields;                           // local field numbers; kNoField if there is none
        std::vector<std::pair<FieldIndex, std::string>> lacking;  // names of those that have none
        std::vector<std::pair<FieldIndex, Value>> defaults;       // defaults that differ here
    };

    void restart();
    void defineHere(std::uint16_t local, std::shared_ptr<const NodeType> definition, bool external, ChangeSet& set);
    Result<> create(Change& change, ChangeSet& set, wire::Budget& budget, bool refusing);
    Result<> define(const Change& change, std::shared_ptr<const NodeType> definition, ChangeSet& set);
    void mapAuthors(ChangeSet& set) const;
    const Type* typeOf(NodeId node) const;
    bool mapField(NodeId node, FieldIndex& field) const;
    bool mapFields(Change& change) const;
    std::unexpected<Diagnostic> lacks(NodeId node, FieldIndex field) const;
    std::unexpected<Diagnostic> lacks(const Change& change) const;
    std::uint16_t numberAtOrigin(std::size_t local) const;
    Result<> mapCalls(std::vector<BehaviourCall>& calls) const;
    Result<> mapUses(std::vector<BehaviourUse>& uses);
    void forgetDestroyed();

    TypeTable local_;
    std::vector<Type> types_;  // by the origin's type index
    std::size_t originBuiltins_ = 0;
    bool same_ = true;
    std::uint16_t nextLocal_ = 0, rootType_ = kNowhere;
    std::unordered_map<std::uint32_t, std::uint16_t> typeOfNode_;
    /// Nodes that the last set destroyed, and those of the set before. A frame whose input was read before it needs
    /// their types once more.
    std::vector<std::uint32_t> destroyed_, destroyedBefore_;
    std::vector<Change> defined_, adjusted_;
    std::vector<BehaviourUse> waiting_;  // behaviours of types that have not been described
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
