// Node types as another build has them, and what a scene of this program does in the numbers of such a build.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <map>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include <rtsg/core/frame_input.h>
#include <rtsg/core/hash_terms.h>
#include <rtsg/core/scene.h>

namespace rtsg::test {

using OtherTypes = std::vector<std::unique_ptr<NodeType>>;

inline std::unique_ptr<NodeType> copyOf(const NodeType& type) {
    auto copy = std::make_unique<NodeType>();
    copy->name = type.name;
    copy->component = type.component;
    copy->level = type.level;
    copy->kind = type.kind;
    copy->containerField = type.containerField;
    copy->implements = type.implements;
    copy->fields = type.fields;
    copy->internal = type.internal;
    return copy;
}

/// This program's types, each after `edit(type)`, which leaves a type out by returning false.
template <class Edit>
OtherTypes otherTypes(const Edit& edit) {
    OtherTypes types;
    for (const auto& type : builtinTypes()) {
        auto copy = copyOf(*type);
        if (!edit(*copy)) continue;
        if (!copy->finish()) std::abort();
        types.push_back(std::move(copy));
    }
    return types;
}

inline std::uint32_t numberOf(TypeTable types, std::string_view name) {
    for (std::size_t i = 0; i < types.size(); ++i)
        if (types[i]->name == name) return static_cast<std::uint32_t>(i);
    return 0xFFFF;
}

/// The term that a field has in the hash of a scene's state.
inline Hash128 termOf(const Scene& scene, NodeId node, FieldIndex field) {
    const Node& there = scene.node(node);
    if (there.isDefault(field)) return {};
    const FieldDef& def = there.type().fields[field];
    return hashOfValue(def.type, there.storage(field), hashSeed(node, fieldKey(def), HashTerm::field));
}
inline Hash128 minus(Hash128 a, Hash128 b) {
    return {a.low - b.low, a.high - b.high - (a.low < b.low ? 1 : 0)};
}

/// Gives sets the numbers of other tables. What those lack is left out. Types of the scene whose names are in the
/// tables become those.
class Renumbered {
  public:
    Renumbered(const Scene& scene, TypeTable types) : scene_(scene), types_(types) {}

    ChangeSet operator()(const ChangeSet& from) {
        ChangeSet set = from;
        translate(set.types);
        translate(set.changes);
        if (set.input) set.input = translated(*set.input);
        if (!set.authors) return set;
        auto authors = std::make_shared<std::vector<Authored>>(*set.authors);
        for (Authored& one : *authors) one.field = theirs(one.node, one.field);
        set.authors = std::move(authors);
        return set;
    }
    FieldIndex field(std::string_view type, std::string_view name) const {
        return types_[numberOf(types_, type)]->findExact(name);
    }

  private:
    std::shared_ptr<const FrameInput> translated(const FrameInput& from) {
        auto input = std::make_shared<FrameInput>(from);
        translate(input->types);
        translate(input->edits);
        translate(input->events);
        for (BehaviourCall& call : input->calls) {
            if (call.kind != BehaviourCall::Kind::onTime) call.field = theirs(call.node, call.field);
            for (BehaviourEffect& effect : call.effects) effect.field = theirs(effect.node, effect.field);
        }
        translate(input->behaviours);
        if (input->runState) {
            auto state = std::make_shared<RunState>(*input->runState);
            translate(state->behaviours);
            input->runState = std::move(state);
        }
        return input;
    }
    const NodeType& ours(NodeId node) const {
        return node.value == 1 ? scene_.node(scene_.root()).type() : scene_.type(TypeIndex{typeOf_.at(node.value)});
    }
    FieldIndex theirs(NodeId node, FieldIndex index) const {
        const NodeType& type = ours(node);
        const bool hasPosition = index != kNoField && numberOf(types_, type.name) != 0xFFFF;
        return hasPosition ? field(type.name, type.fields[index].name) : index;
    }
    std::uint32_t number(std::uint32_t ours) const {
        const std::uint32_t there = numberOf(types_, scene_.type(TypeIndex{static_cast<std::uint16_t>(ours)}).name);
        return there != 0xFFFF ? there : own_.at(ours);
    }
    void translate(std::vector<DefinedType>& types) {
        std::erase_if(types, [&](const DefinedType& one) { return numberOf(types_, one.type->name) != 0xFFFF; });
        for (DefinedType& one : types) {
            own_.try_emplace(one.index.value, static_cast<std::uint32_t>(types_.size() + own_.size()));
            one.index = TypeIndex{static_cast<std::uint16_t>(own_.at(one.index.value))};
        }
    }
    void translate(std::vector<BehaviourUse>& uses) const {
        for (BehaviourUse& use : uses) use.type = TypeIndex{static_cast<std::uint16_t>(number(use.type.value))};
    }
    void translate(std::vector<Change>& changes) {
        std::erase_if(changes, [&](Change& change) { return !translate(change); });
    }
    /// Returns false for what the other tables lack, or have as a type of their own.
    bool translate(Change& change) {
        switch (change.kind) {
            case ChangeKind::defineType:
                if (!own_.contains(change.index)) return false;
                change.index = own_.at(change.index);
                return true;
            case ChangeKind::createNode:
                typeOf_[change.node.value] = static_cast<std::uint16_t>(change.index);
                change.index = number(change.index);
                return true;
            case ChangeKind::addRoute:
            case ChangeKind::removeRoute:
                change.index = theirs(change.other, change.field2());
                change.field = theirs(change.node, change.field);
                return change.index != kNoField && change.field != kNoField;
            case ChangeKind::setName:
            case ChangeKind::destroyNode:
                return true;
            default:
                change.field = theirs(change.node, change.field);
                return change.field != kNoField;
        }
    }

    const Scene& scene_;
    TypeTable types_;
    std::map<std::uint32_t, std::uint16_t> typeOf_;  // numbers here, by node
    std::map<std::uint32_t, std::uint32_t> own_;     // types of the scene's own: numbers there, by those here
};

}  // namespace rtsg::test
