// Computes the state hash of a stream from its changes alone.
#include "origin_hash.h"

#include <rtsg/core/hash_terms.h>

namespace rtsg {

namespace {

Hash128 operator-(Hash128 a, Hash128 b) {
    return {a.low - b.low, a.high - b.high - (a.low < b.low ? 1 : 0)};
}

/// The hash term of two neighbours in a list; 0 stands for a node beyond either end.
Hash128 pairTerm(NodeId a, NodeId b, std::uint64_t seed) {
    const std::uint32_t pair[2] = {a.value, b.value};
    return hashOfBytes(pair, sizeof(pair), seed);
}

}  // namespace

OriginHash::OriginHash(const StreamHead& head, TypeTable own)
    : byNumber_(head.formatVersion < 3), builtins_(head.builtinTypes), types_(builtins_) {
    for (std::size_t i = 0; i < std::min(own.size(), builtins_); ++i)  // the types outlive this
        define(i, std::shared_ptr<const NodeType>(std::shared_ptr<const NodeType>(), own[i].get()));
    restart();
}

void OriginHash::restart() {
    types_.resize(builtins_);
    nodes_.clear();
    nodes_[1].type = rootType_;
    sum_ = {};
}

void OriginHash::define(std::size_t number, std::shared_ptr<const NodeType> type) {
    Type& entry = types_[number];
    entry.name = hashOfText(type->name);
    for (const FieldDef& field : type->fields) entry.keys.push_back(fieldKey(field));
    if (number < builtins_ && type->name == "RtsgScene")
        nodes_[1].type = rootType_ = static_cast<std::uint16_t>(number);
    entry.type = std::move(type);
}

void OriginHash::describe(std::uint16_t number, std::shared_ptr<const NodeType> type) {
    if (number < builtins_ && !types_[number].type) define(number, std::move(type));
}

/// Returns null if there is no such type or field.
const FieldDef* OriginHash::fieldOf(const Node& node, FieldIndex field) const {
    if (node.type >= types_.size() || !types_[node.type].type) return nullptr;
    const std::vector<FieldDef>& fields = types_[node.type].type->fields;
    return field < fields.size() && fields[field].readable() ? &fields[field] : nullptr;
}

std::uint64_t OriginHash::seed(NodeId node, const Type* type, FieldIndex field, HashTerm term) const {
    if (byNumber_)
        return std::uint64_t{node.value} << 32 | std::uint64_t{field} << 16 | static_cast<std::uint64_t>(term);
    return hashSeed(node, type ? type->keys[field] : 0, term);
}

void OriginHash::replace(Hash128& term, Hash128 by) {
    sum_ = sum_ - term + by;
    term = by;
}

Hash128 OriginHash::listTerm(NodeId node, const Type& type, FieldIndex field,
                             const std::vector<NodeId>& children) const {
    Hash128 sum;
    if (children.empty()) return sum;
    const std::uint64_t s = seed(node, &type, field, HashTerm::children);
    for (std::size_t i = 0; i <= children.size(); ++i)
        sum = sum + pairTerm(i > 0 ? children[i - 1] : NodeId{}, i < children.size() ? children[i] : NodeId{}, s);
    return sum;
}

void OriginHash::create(const Change& change) {
    if (change.index >= types_.size() || !types_[change.index].type) return;
    const auto [entry, fresh] = nodes_.try_emplace(change.node.value);
    if (!fresh) return;
    entry->second.type = static_cast<std::uint16_t>(change.index);
    const std::uint64_t parts[2] = {types_[change.index].name, change.other.value};
    replace(entry->second.own, hashOfBytes(parts, sizeof(parts), seed(change.node, nullptr, kNoField, HashTerm::node)));
}

void OriginHash::setField(Node& node, const Change& change) {
    const FieldDef* def = fieldOf(node, change.field);
    if (!def || !def->holds(change.value)) return;
    const Type& type = types_[node.type];
    if (equalStorage(def->type, change.value.storage(), def->defaultValue.storage())) {
        if (const auto found = node.fields.find(change.field); found != node.fields.end()) {
            replace(found->second.term, {});
            node.fields.erase(found);
        }
        return;
    }
    Field& field = node.fields[change.field];
    if (def->type == FieldType::MFNode) {
        const auto& children = change.value.as<Array<NodeId>>();
        field.children.assign(children.begin(), children.end());
        return replace(field.term, listTerm(change.node, type, change.field, field.children));
    }
    replace(field.term,
            hashOfValue(def->type, change.value.storage(), seed(change.node, &type, change.field, HashTerm::field)));
}

void OriginHash::changeChildren(Node& node, const Change& change) {
    const FieldDef* def = fieldOf(node, change.field);
    if (!def || def->type != FieldType::MFNode) return;
    Field& field = node.fields[change.field];
    std::vector<NodeId>& children = field.children;
    const bool inserts = change.kind == ChangeKind::insertChild;
    const std::size_t at = change.index, next = at + (inserts ? 0 : 1);
    if (next > children.size()) return;
    const std::uint64_t s = seed(change.node, &types_[node.type], change.field, HashTerm::children);
    const NodeId before = at > 0 ? children[at - 1] : NodeId{};
    const NodeId after = next < children.size() ? children[next] : NodeId{};
    const NodeId child = inserts ? change.other : children[at];
    const Hash128 with = pairTerm(before, child, s) + pairTerm(child, after, s);
    // No neighbours on either side means that the list is empty, so there is no pair.
    const Hash128 without = before || after ? pairTerm(before, after, s) : Hash128{};
    replace(field.term, inserts ? field.term - without + with : field.term - with + without);
    const auto position = children.begin() + static_cast<std::ptrdiff_t>(at);
    if (inserts)
        children.insert(position, child);
    else
        children.erase(position);
}

void OriginHash::setName(Node& node, const Change& change) {
    if (!change.value.holds<String>()) return;
    const std::string_view name = change.value.as<String>().view();
    replace(node.name,
            name.empty() ? Hash128{}
                         : hashOfBytes(name.data(), name.size(), seed(change.node, nullptr, kNoField, HashTerm::name)));
}

void OriginHash::changeRoute(const Node& from, const Change& change) {
    const auto to = nodes_.find(change.other.value);
    if (to == nodes_.end() || from.type >= types_.size() || to->second.type >= types_.size()) return;
    const Type &sender = types_[from.type], &receiver = types_[to->second.type];
    if (change.field >= sender.keys.size() || change.field2() >= receiver.keys.size()) return;
    const std::uint64_t s = seed(change.node, &sender, change.field, HashTerm::route);
    const std::uint32_t numbers[2] = {change.other.value,
                                      std::uint32_t{change.field2()} | (change.isConnection ? 0x10000u : 0u)};
    const std::uint64_t names[2] = {receiver.keys[change.field2()],
                                    change.other.value | (change.isConnection ? std::uint64_t{1} << 32 : 0)};
    const Hash128 term = byNumber_ ? hashOfBytes(numbers, sizeof(numbers), s) : hashOfBytes(names, sizeof(names), s);
    sum_ = change.kind == ChangeKind::addRoute ? sum_ + term : sum_ - term;
}

void OriginHash::destroy(NodeId id) {
    const auto found = nodes_.find(id.value);
    if (found == nodes_.end() || id.value == 1) return;
    sum_ = sum_ - found->second.own - found->second.name;
    for (const auto& [index, field] : found->second.fields) sum_ = sum_ - field.term;
    nodes_.erase(found);
}

void OriginHash::follow(const ChangeSet& set) {
    if (set.isSnapshot()) restart();
    for (const DefinedType& type : set.types) {
        if (type.index.value != types_.size()) continue;
        types_.emplace_back();
        define(type.index.value, type.type);
    }
    for (const Change& change : set.changes) {
        if (change.kind == ChangeKind::createNode) {
            create(change);
            continue;
        }
        const auto found = nodes_.find(change.node.value);
        if (found == nodes_.end()) continue;
        switch (change.kind) {
            case ChangeKind::setField:
                setField(found->second, change);
                break;
            case ChangeKind::insertChild:
            case ChangeKind::removeChild:
                changeChildren(found->second, change);
                break;
            case ChangeKind::setName:
                setName(found->second, change);
                break;
            case ChangeKind::addRoute:
            case ChangeKind::removeRoute:
                changeRoute(found->second, change);
                break;
            case ChangeKind::destroyNode:
                destroy(change.node);
                break;
            case ChangeKind::createNode:
            case ChangeKind::defineType:
            case ChangeKind::event:
                break;
        }
    }
}

}  // namespace rtsg
