// Keeps track of the types in a stream of another build, and rewrites its sets to the numbers of this program.
#include "type_mapping.h"

#include <algorithm>

#include <fmt/format.h>

#include "columns/wire.h"

namespace rtsg {

TypeMapping::TypeMapping(TypeTable local, std::size_t originBuiltins)
    : local_(local), types_(originBuiltins), originBuiltins_(originBuiltins) {
    restart();
}

void TypeMapping::restart() {
    types_.resize(originBuiltins_);
    for (Type& type : types_)
        if (type.definition) type.local = kNowhere;
    nextLocal_ = static_cast<std::uint16_t>(local_.size());
    typeOfNode_ = {{1u, rootType_}};
}

bool TypeMapping::describe(std::uint16_t number, const NodeType& origin) {
    if (number >= originBuiltins_) return false;
    Type& type = types_[number];
    if (type.known) return true;
    type.known = true;
    const auto here = std::ranges::find(local_, origin.name, [](const auto& t) -> const auto& { return t->name; });
    if (here == local_.end()) {
        ByteBuffer copy;
        wire::putType(copy, origin);
        wire::Reader in(copy.bytes());
        std::unique_ptr<NodeType> definition = wire::readType(in);
        definition->kind = NodeType::Kind::user;
        type.definition = std::move(definition);
        type.identity = true;
        same_ = false;
        return true;
    }
    const NodeType& local = **here;
    type.local = static_cast<std::uint16_t>(here - local_.begin());
    for (const FieldDef& field : origin.fields) {
        FieldIndex index = local.findExact(field.name);
        if (index != kNoField && !haveOneType(local.fields[index], field)) index = kNoField;
        type.fields.push_back(index);
        if (index != kNoField && field.offset != FieldDef::kNoOffset &&
            local.fields[index].offset != FieldDef::kNoOffset && sf(field.type) != FieldType::SFNode &&
            !(local.fields[index].defaultValue == field.defaultValue))
            type.defaults.emplace_back(index, field.defaultValue);
    }
    same_ = same_ && type.defaults.empty() && type.fields.size() == local.fields.size();
    for (std::size_t i = 0; i < type.fields.size(); ++i) same_ = same_ && type.fields[i] == i;
    if (origin.name == "RtsgScene") {
        rootType_ = number;
        typeOfNode_[1] = number;
    }
    return true;
}

Result<> TypeMapping::renumber(ChangeSet& set) const {
    const auto own = [&](std::size_t type) { return type - originBuiltins_ + local_.size(); };
    for (Change& change : set.changes) {
        if (change.kind != ChangeKind::createNode && change.kind != ChangeKind::defineType) continue;
        const bool isBuiltin = change.index < originBuiltins_;
        if ((isBuiltin && change.kind == ChangeKind::defineType) || (!isBuiltin && own(change.index) >= kNowhere))
            return fail(fmt::format("type {} cannot be defined", change.index));
        change.index = isBuiltin ? types_[change.index].local : static_cast<std::uint32_t>(own(change.index));
    }
    for (DefinedType& type : set.types) type.index = TypeIndex{static_cast<std::uint16_t>(own(type.index.value))};
    return {};
}

void TypeMapping::defineHere(Type& type, std::shared_ptr<const NodeType> definition, bool external, ChangeSet& set) {
    type.local = nextLocal_++;
    Change change = blankChange(ChangeKind::defineType, {}, kNoField, external);
    change.index = type.local;
    defined_.push_back(std::move(change));
    set.types.push_back({TypeIndex{type.local}, std::move(definition)});
}

/// Returns false if the field has no counterpart here.
bool TypeMapping::mapField(NodeId node, FieldIndex& field, DecoderLosses& losses) const {
    const auto found = typeOfNode_.find(node.value);
    if (found == typeOfNode_.end() || found->second >= types_.size()) return true;  // the scene will check
    const Type& type = types_[found->second];
    if (type.identity) return true;
    if (field >= type.fields.size() || type.fields[field] == kNoField) {
        ++losses.changes;
        return false;
    }
    field = type.fields[field];
    return true;
}

FieldIndex TypeMapping::fieldAtOrigin(NodeId node, FieldIndex field) const {
    const auto found = typeOfNode_.find(node.value);
    if (found == typeOfNode_.end() || found->second >= types_.size()) return kNoField;
    const Type& type = types_[found->second];
    if (type.identity) return field;
    const auto at = std::ranges::find(type.fields, field);
    return at == type.fields.end() ? kNoField : static_cast<FieldIndex>(at - type.fields.begin());
}

void TypeMapping::mapAuthors(ChangeSet& set) const {
    auto mapped = std::make_shared<std::vector<Authored>>();
    DecoderLosses ignored;  // the change itself has been counted as lost already
    for (Authored one : *set.authors)
        if (one.field == kNoField || mapField(one.node, one.field, ignored)) mapped->push_back(std::move(one));
    set.authors = std::move(mapped);
}

Result<> TypeMapping::toLocal(ChangeSet& set, wire::Budget& budget, DecoderLosses& losses) {
    if (set.isSnapshot()) restart();
    std::vector<Change> adjusted;
    defined_.clear();
    std::size_t kept = 0;  // changes that stay; they are moved to the front of set.changes
    const std::vector<DefinedType> originTypes = std::exchange(set.types, {});
    std::size_t nextType = 0;
    for (Change& change : set.changes) {
        switch (change.kind) {
            case ChangeKind::defineType: {
                if (change.index != types_.size())
                    return fail(fmt::format("type {} defined out of turn, {} is next", change.index, types_.size()));
                Type& type = types_.emplace_back();
                type.known = type.identity = true;
                defineHere(type, originTypes[nextType++].type, change.external, set);
                continue;
            }
            case ChangeKind::createNode: {
                if (change.index >= types_.size() || !types_[change.index].known)
                    return fail(fmt::format("node of type {}, which was not described", change.index));
                Type& type = types_[change.index];
                typeOfNode_[change.node.value] = static_cast<std::uint16_t>(change.index);
                if (type.local == kNowhere) defineHere(type, type.definition, change.external, set);
                change.index = type.local;
                if (!budget.take(4 * type.defaults.size() * sizeof(Change)))  // in both vectors, as they grow
                    return fail("nodes whose defaults differ here take more memory than a record of this length may");
                for (const auto& [field, value] : type.defaults) {
                    adjusted.push_back(blankChange(ChangeKind::setField, change.node, field, change.external));
                    adjusted.back().value = value;
                }
                break;
            }
            case ChangeKind::addRoute:
            case ChangeKind::removeRoute: {
                FieldIndex target = change.field2();
                if (!mapField(change.node, change.field, losses) || !mapField(change.other, target, losses)) continue;
                change.index = target;
                break;
            }
            case ChangeKind::setField:
            case ChangeKind::insertChild:
            case ChangeKind::removeChild:
            case ChangeKind::event:
                if (!mapField(change.node, change.field, losses)) continue;
                break;
            case ChangeKind::destroyNode:
                typeOfNode_.erase(change.node.value);
                break;
            case ChangeKind::setName:
                break;
        }
        if (&set.changes[kept] != &change) set.changes[kept] = std::move(change);
        ++kept;
    }
    std::vector<Change>& changes = set.changes;
    changes.resize(kept);
    if (set.authors) mapAuthors(set);
    if (adjusted.empty() && defined_.empty()) return {};
    if (!budget.take((kept + defined_.size()) * sizeof(Change)))  // held twice for a moment
        return fail("types that are unknown here take more memory than a record of this length may");
    const std::size_t creates = static_cast<std::size_t>(
        std::ranges::find_if(changes, [](const Change& c) { return c.kind != ChangeKind::createNode; }) -
        changes.begin());
    changes.reserve(kept + adjusted.size() + defined_.size());
    changes.insert(changes.begin() + static_cast<std::ptrdiff_t>(creates), std::move_iterator(adjusted.begin()),
                   std::move_iterator(adjusted.end()));
    changes.insert(changes.begin(), std::move_iterator(defined_.begin()), std::move_iterator(defined_.end()));
    return {};
}

}  // namespace rtsg
