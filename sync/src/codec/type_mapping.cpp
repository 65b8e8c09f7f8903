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
    destroyed_.clear();
    destroyedBefore_.clear();
}

bool TypeMapping::describe(std::uint16_t number, std::shared_ptr<const NodeType> described) {
    if (number >= originBuiltins_) return false;
    Type& type = types_[number];
    if (type.known) return true;
    type.known = true;
    type.description = std::move(described);
    const NodeType& origin = *type.description;
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
        if (index == kNoField) type.lacking.emplace_back(static_cast<FieldIndex>(type.fields.size()), field.name);
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

/// Defines a type of the stream's own, where the input of the frame has not done so before.
Result<> TypeMapping::define(const Change& change, std::shared_ptr<const NodeType> definition, ChangeSet& set) {
    if (change.index > types_.size() || change.index < originBuiltins_)
        return fail(fmt::format("type {} defined out of turn, {} is next", change.index, types_.size()));
    if (change.index == types_.size()) {
        Type& type = types_.emplace_back();
        type.known = type.identity = true;
        type.local = nextLocal_++;
    }
    defineHere(types_[change.index].local, std::move(definition), change.external, set);
    return {};
}

void TypeMapping::defineHere(std::uint16_t local, std::shared_ptr<const NodeType> definition, bool external,
                             ChangeSet& set) {
    Change change = blankChange(ChangeKind::defineType, {}, kNoField, external);
    change.index = local;
    defined_.push_back(std::move(change));
    set.types.push_back({TypeIndex{local}, std::move(definition)});
}

/// Returns null if the node is unknown; then the scene will check.
const TypeMapping::Type* TypeMapping::typeOf(NodeId node) const {
    const auto found = typeOfNode_.find(node.value);
    return found == typeOfNode_.end() || found->second >= types_.size() ? nullptr : &types_[found->second];
}

/// Returns false if the field has no counterpart here.
bool TypeMapping::mapField(NodeId node, FieldIndex& field) const {
    const Type* type = typeOf(node);
    if (!type || type->identity) return true;
    if (field >= type->fields.size() || type->fields[field] == kNoField) return false;
    field = type->fields[field];
    return true;
}

/// Returns false, and leaves the change as it is, if one of its fields has no counterpart here.
bool TypeMapping::mapFields(Change& change) const {
    switch (change.kind) {
        case ChangeKind::addRoute:
        case ChangeKind::removeRoute: {
            FieldIndex target = change.field2();
            if (!mapField(change.other, target) || !mapField(change.node, change.field)) return false;
            change.index = target;
            return true;
        }
        case ChangeKind::setField:
        case ChangeKind::insertChild:
        case ChangeKind::removeChild:
        case ChangeKind::event:
            return mapField(change.node, change.field);
        default:
            return true;
    }
}

/// The error that a field has no counterpart here.
std::unexpected<Diagnostic> TypeMapping::lacks(NodeId node, FieldIndex field) const {
    const Type* type = typeOf(node);
    if (!type || type->local >= local_.size()) return fail(fmt::format("node {} has no field {}", node.value, field));
    const std::string& name = local_[type->local]->name;
    const auto lacking = std::ranges::find(type->lacking, field, &std::pair<FieldIndex, std::string>::first);
    if (lacking == type->lacking.end()) return fail(fmt::format("a {} has no field {}", name, field));
    return fail(fmt::format("it needs {}.{}, and the {} of this program has no such field of that type", name,
                            lacking->second, name));
}

std::unexpected<Diagnostic> TypeMapping::lacks(const Change& change) const {
    FieldIndex field = change.field;
    const bool isRoute = change.kind == ChangeKind::addRoute || change.kind == ChangeKind::removeRoute;
    if (isRoute && mapField(change.node, field)) return lacks(change.other, change.field2());
    return lacks(change.node, change.field);
}

std::string TypeMapping::lackingHere() const {
    constexpr std::size_t kMax = 3;
    std::string names;
    std::size_t count = 0;
    for (const Type& type : types_)
        for (const auto& [field, name] : type.lacking)
            if (++count <= kMax) names += fmt::format("{}{}.{}", count > 1 ? ", " : "", local_[type.local]->name, name);
    return count > kMax ? fmt::format("{} and {} more", names, count - kMax) : names;
}

FieldIndex TypeMapping::fieldAtOrigin(NodeId node, FieldIndex field) const {
    const Type* type = typeOf(node);
    if (!type) return kNoField;
    if (type->identity) return field;
    const auto at = std::ranges::find(type->fields, field);
    return at == type->fields.end() ? kNoField : static_cast<FieldIndex>(at - type->fields.begin());
}

void TypeMapping::mapAuthors(ChangeSet& set) const {
    auto mapped = std::make_shared<std::vector<Authored>>();
    for (Authored one : *set.authors)
        if (one.field == kNoField || mapField(one.node, one.field)) mapped->push_back(std::move(one));
    set.authors = std::move(mapped);
}

Result<> TypeMapping::create(Change& change, ChangeSet& set, wire::Budget& budget, bool refusing) {
    if (change.index >= types_.size() || !types_[change.index].known)
        return fail(fmt::format("node of type {}, which was not described", change.index));
    Type& type = types_[change.index];
    if (type.definition && refusing)
        return fail(fmt::format("it needs {}, a node type that this program lacks", type.definition->name));
    typeOfNode_[change.node.value] = static_cast<std::uint16_t>(change.index);
    if (type.local == kNowhere) {
        type.local = nextLocal_++;
        defineHere(type.local, type.definition, change.external, set);
    }
    change.index = type.local;
    if (!budget.take(4 * type.defaults.size() * sizeof(Change)))  // in both vectors, as they grow
        return fail("nodes whose defaults differ here take more memory than a record of this length may");
    for (const auto& [field, value] : type.defaults) {
        adjusted_.push_back(blankChange(ChangeKind::setField, change.node, field, change.external));
        adjusted_.back().value = value;
    }
    return {};
}

void TypeMapping::forgetDestroyed() {
    for (const std::uint32_t node : destroyedBefore_) typeOfNode_.erase(node);
    destroyedBefore_.swap(destroyed_);
    destroyed_.clear();
}

Result<> TypeMapping::toLocal(ChangeSet& set, wire::Budget& budget, DecoderLosses* losses) {
    forgetDestroyed();
    if (set.isSnapshot()) restart();
    adjusted_.clear();
    defined_.clear();
    std::size_t kept = 0;  // changes that stay; they are moved to the front of set.changes
    const std::vector<DefinedType> originTypes = std::exchange(set.types, {});
    std::size_t nextType = 0;
    for (Change& change : set.changes) {
        if (change.kind == ChangeKind::defineType) {
            if (auto ok = define(change, originTypes[nextType++].type, set); !ok) return ok;
            continue;
        }
        if (change.kind == ChangeKind::createNode)
            if (auto ok = create(change, set, budget, !losses); !ok) return ok;
        if (change.kind == ChangeKind::destroyNode) destroyed_.push_back(change.node.value);
        if (!mapFields(change)) {
            if (!losses) return lacks(change);
            ++losses->changes;
            continue;
        }
        if (&set.changes[kept] != &change) set.changes[kept] = std::move(change);
        ++kept;
    }
    std::vector<Change>& changes = set.changes;
    changes.resize(kept);
    if (set.authors) mapAuthors(set);
    if (adjusted_.empty() && defined_.empty()) return {};
    if (!budget.take((kept + defined_.size()) * sizeof(Change)))  // held twice for a moment
        return fail("types that are unknown here take more memory than a record of this length may");
    const std::size_t creates = static_cast<std::size_t>(
        std::ranges::find_if(changes, [](const Change& c) { return c.kind != ChangeKind::createNode; }) -
        changes.begin());
    changes.reserve(kept + adjusted_.size() + defined_.size());
    changes.insert(changes.begin() + static_cast<std::ptrdiff_t>(creates), std::move_iterator(adjusted_.begin()),
                   std::move_iterator(adjusted_.end()));
    changes.insert(changes.begin(), std::move_iterator(defined_.begin()), std::move_iterator(defined_.end()));
    return {};
}

// ---- inputs ------------------------------------------------------------------------------------------------------

Result<> TypeMapping::mapCalls(std::vector<BehaviourCall>& calls) const {
    for (BehaviourCall& call : calls) {
        if (call.kind != BehaviourCall::Kind::onTime && !mapField(call.node, call.field))
            return lacks(call.node, call.field);
        for (BehaviourEffect& effect : call.effects)
            if (!mapField(effect.node, effect.field)) return lacks(effect.node, effect.field);
    }
    return {};
}

/// No node of a type that has not been described exists, so its behaviour is not needed yet.
Result<> TypeMapping::mapUses(std::vector<BehaviourUse>& uses) {
    for (const BehaviourUse& use : uses) {
        if (use.type.value >= types_.size()) return fail("a behaviour of an unknown node type");
        const auto known = std::ranges::find(waiting_, use.type, &BehaviourUse::type);
        if (known != waiting_.end())
            *known = use;
        else
            waiting_.push_back(use);
    }
    uses.clear();
    std::erase_if(waiting_, [&](const BehaviourUse& use) {
        const Type& type = types_[use.type.value];
        if (!type.known || type.local == kNowhere) return false;
        uses.push_back(use);
        uses.back().type = TypeIndex{type.local};
        return true;
    });
    return {};
}

Result<> TypeMapping::toLocal(FrameInput& input, RunState* state) {
    if (auto ok = mapCalls(input.calls); !ok) return ok;
    if (!state) return mapUses(input.behaviours);
    waiting_.clear();
    return mapUses(state->behaviours);
}

/// kNowhere if the writer lacks the type.
std::uint16_t TypeMapping::numberAtOrigin(std::size_t local) const {
    const auto found = std::ranges::find(types_, local, &Type::local);
    return found == types_.end() ? kNowhere : static_cast<std::uint16_t>(found - types_.begin());
}

ChangeSet TypeMapping::toOrigin(const ChangeSet& set) const {
    ChangeSet result;
    result.from = set.from;
    result.to = set.to;
    for (const DefinedType& type : set.types)
        result.types.push_back({TypeIndex{numberAtOrigin(type.index.value)}, type.type});
    result.changes.reserve(set.changes.size());
    for (Change change : set.changes) {
        if (change.kind == ChangeKind::createNode || change.kind == ChangeKind::defineType)
            change.index = numberAtOrigin(change.index);
        if (change.kind == ChangeKind::addRoute || change.kind == ChangeKind::removeRoute)
            change.index = fieldAtOrigin(change.other, change.field2());
        const bool hasField = change.field != kNoField;
        if (hasField) change.field = fieldAtOrigin(change.node, change.field);
        if (hasField && change.field == kNoField) continue;
        result.changes.push_back(std::move(change));
    }
    return result;
}

}  // namespace rtsg
