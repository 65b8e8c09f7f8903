// Reachability over fields: what acts is where it starts; routes, IS connections and nodes that answer their inputs
// are its edges. Removals first take back everything that was reached through what went, then give back what another
// way still reaches: a cycle does not support itself.
#include <rtsg/core/mobility.h>

#include <algorithm>
#include <unordered_map>

#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

struct FieldRef {
    NodeId node;
    FieldIndex field = kNoField;
};

struct TypeFacts {
    Acts acts = Acts::never;
    bool reaches = false;         // may change other nodes without a route: Script, HAnimHumanoid
    std::vector<bool> own;        // changes when the node acts
    std::vector<bool> settable;   // an event can change it
    std::vector<bool> held;       // may change when a script has hold of the node
    std::vector<FieldIndex> set;  // by field: what an event here changes besides (set_coordIndex: coordIndex), or none
};

/// set_coordIndex -> coordIndex, addChildren and removeChildren -> children.
FieldIndex counterpart(const NodeType& type, const FieldDef& def) {
    if (def.access != Access::inputOnly) return kNoField;
    const auto lowered = [&](std::size_t skip) {
        std::string name = def.name.substr(skip);
        if (!name.empty() && name[0] >= 'A' && name[0] <= 'Z') name[0] = static_cast<char>(name[0] - 'A' + 'a');
        return name;
    };
    FieldIndex found = kNoField;
    if (def.name.starts_with("set_")) found = type.findExact(def.name.substr(4));
    if (def.name.starts_with("add")) found = type.findExact(lowered(3));
    if (def.name.starts_with("remove")) found = type.findExact(lowered(6));
    return found != kNoField && type.fields[found].readable() ? found : kNoField;
}

/// One without fields of its own is of the built-in type.
bool isScriptType(const NodeType& type) {
    return type.kind == NodeType::Kind::script || (type.kind == NodeType::Kind::builtin && type.isA("X3DScriptNode"));
}

TypeFacts factsOf(const NodeType& type) {
    TypeFacts facts;
    const std::size_t count = type.fields.size();
    const bool isScript = isScriptType(type);
    facts.reaches = isScript;
    // A PROTO instance does not act itself, but nodes of its body may.
    facts.acts = isScript ? Acts::always : type.acts == Acts::unstated ? Acts::never : type.acts;
    facts.own.resize(count);
    facts.settable.resize(count);
    facts.set.assign(count, kNoField);
    for (FieldIndex i = 0; i < count; ++i) {
        const FieldDef& def = type.fields[i];
        if (!def.hidden && def.writable()) facts.settable[i] = true;
        facts.set[i] = counterpart(type, def);
        if (facts.set[i] != kNoField) facts.settable[facts.set[i]] = true;
        if (facts.acts != Acts::never && (def.access == Access::outputOnly || def.hidden)) facts.own[i] = true;
    }
    const bool writesAll = isScript || type.writesInputs;
    if (facts.acts != Acts::never && writesAll)
        for (FieldIndex i = 0; i < count; ++i)
            if (type.fields[i].access == Access::inputOutput) facts.own[i] = true;
    facts.held = facts.settable;
    for (FieldIndex i = 0; i < count; ++i)
        if (facts.acts == Acts::onInput && facts.own[i]) facts.held[i] = true;
    return facts;
}

}  // namespace

struct Mobility::State {
    struct Entry {
        std::vector<FieldIndex> reached;  // besides those that base() knows
    };
    struct Script {
        std::vector<NodeId> nodes, scopes;
    };
    const Scene* scene = nullptr;
    std::vector<std::unique_ptr<TypeFacts>> facts;  // by TypeIndex, made when first needed
    std::unordered_map<std::uint32_t, Entry> entries;
    std::unordered_map<std::uint32_t, Script> scripts;
    std::unordered_map<std::uint32_t, std::uint32_t> referred, open;  // to the number of scripts
    std::vector<NodeId> changedNodes, changedScopes;
    std::vector<FieldRef> removed, added;  // work in hand

    const TypeFacts& factsFor(TypeIndex type) {
        if (facts.size() <= type.value) facts.resize(std::size_t{type.value} + 1);
        auto& entry = facts[type.value];
        if (!entry) {
            entry = std::make_unique<TypeFacts>(factsOf(scene->type(type)));
            entry->reaches |= type == x3d::HAnimHumanoid::type;
        }
        return *entry;
    }
    /// Inlines in an open scope are open too: their exports can be had, and what hangs on them.
    bool anyScope(NodeId scope, const auto& holds) const {
        for (;;) {
            if (holds(scope)) return true;
            const Node* owner = scope ? scene->find(scope) : nullptr;
            if (!owner || !owner->is(x3d::Inline::type)) return false;
            scope = owner->scope();
        }
    }
    bool isOpen(NodeId scope) const {
        return !open.empty() && anyScope(scope, [&](NodeId one) { return open.contains(one.value); });
    }
    bool inHands(const Node& node) const {
        return (!referred.empty() && referred.contains(node.id().value)) || isOpen(node.scope());
    }
    bool base(const Node& node, const TypeFacts& f, FieldIndex field) const {
        return (f.acts == Acts::always && f.own[field]) || (f.held[field] && inHands(node));
    }
    bool reached(NodeId node, FieldIndex field) const {
        const auto entry = entries.find(node.value);
        return entry != entries.end() && std::ranges::binary_search(entry->second.reached, field);
    }
    bool active(const Node& node, FieldIndex field) {
        return reached(node.id(), field) || base(node, factsFor(node.typeIndex()), field);
    }
    bool store(NodeId node, FieldIndex field) {
        auto& fields = entries[node.value].reached;
        const auto found = std::ranges::lower_bound(fields, field);
        if (found != fields.end() && *found == field) return false;
        fields.insert(found, field);
        changedNodes.push_back(node);
        return true;
    }
    bool take(NodeId node, FieldIndex field) {
        const auto entry = entries.find(node.value);
        if (entry == entries.end()) return false;
        auto& fields = entry->second.reached;
        const auto found = std::ranges::lower_bound(fields, field);
        if (found == fields.end() || *found != field) return false;
        fields.erase(found);
        if (fields.empty()) entries.erase(entry);
        changedNodes.push_back(node);
        return true;
    }

    /// Adds the fields that a change of `field` may change next.
    void successors(const Node& node, FieldIndex field, std::vector<FieldRef>& out) {
        const TypeFacts& f = factsFor(node.typeIndex());
        if (f.set[field] != kNoField) out.push_back({node.id(), f.set[field]});
        if (f.acts == Acts::onInput && f.settable[field])
            for (FieldIndex i = 0; i < f.own.size(); ++i)
                if (f.own[i]) out.push_back({node.id(), i});
        for (const Route& route : scene->routesFrom(node.id()))
            if (route.fromField == field) out.push_back({route.toNode, route.toField});
    }
    /// Whether a field is reached from outside itself.
    bool supported(const Node& node, FieldIndex field) {
        const TypeFacts& f = factsFor(node.typeIndex());
        for (FieldIndex i = 0; i < f.set.size(); ++i) {
            const bool leadsHere = f.set[i] == field || (f.acts == Acts::onInput && f.own[field] && f.settable[i]);
            if (leadsHere && i != field && active(node, i)) return true;
        }
        for (const Route& route : scene->routesTo(node.id()))
            if (route.toField == field && active(scene->node(route.fromNode), route.fromField)) return true;
        return false;
    }

    /// The joints that HAnimMotions and HAnimPoses of a humanoid may move.
    Script jointsOf(const Node& humanoid) const {
        using H = x3d::HAnimHumanoid;
        Script reach;
        if (humanoid.get(H::motions).empty() && humanoid.get(H::children).empty()) return reach;
        for (const NodeId id : humanoid.get(H::joints).span())
            if (const Node* joint = scene->effectiveNode(id)) reach.nodes.push_back(joint->id());
        std::ranges::sort(reach.nodes);
        reach.nodes.erase(std::unique(reach.nodes.begin(), reach.nodes.end()), reach.nodes.end());
        return reach;
    }
    /// A Script's nodes and name spaces, as the scene has them now; none if it is gone.
    Script reachOf(NodeId id) const {
        Script reach;
        const Node* node = scene->find(id);
        if (node && node->is(x3d::HAnimHumanoid::type)) return jointsOf(*node);
        if (!node || !isScriptType(node->type())) return reach;
        const NodeType& type = node->type();
        const FieldIndex direct = type.findExact("directOutput");
        bool wide = direct != kNoField && node->value(direct) == Value(true);
        for (const FieldIndex i : type.nodeFields()) {
            if (!type.fields[i].readable()) continue;
            if (type.fields[i].type == FieldType::SFNode) {
                if (const NodeId one = *static_cast<const NodeId*>(node->storage(i))) reach.nodes.push_back(one);
            } else {
                for (const NodeId one : *static_cast<const Array<NodeId>*>(node->storage(i)))
                    if (one) reach.nodes.push_back(one);
            }
        }
        // Through a route it can come to hold any node: the same as direct output.
        for (const Route& route : scene->routesTo(id)) wide |= sf(type.fields[route.toField].type) == FieldType::SFNode;
        if (wide) {
            reach.scopes.push_back(node->scope());
            for (const NodeId one : reach.nodes) reach.scopes.push_back(scene->node(one).scope());
        }
        for (auto* list : {&reach.nodes, &reach.scopes}) {
            std::ranges::sort(*list);
            list->erase(std::unique(list->begin(), list->end()), list->end());
        }
        return reach;
    }
    static void count(std::unordered_map<std::uint32_t, std::uint32_t>& counts, std::span<const NodeId> ids, bool up,
                      std::vector<NodeId>& changed) {
        for (const NodeId id : ids) {
            if (up) {
                if (++counts[id.value] == 1) changed.push_back(id);
            } else if (const auto found = counts.find(id.value); --found->second == 0) {
                counts.erase(found);
                changed.push_back(id);
            }
        }
    }
    void updateScripts(std::vector<NodeId>& touched) {
        std::ranges::sort(touched);
        touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
        std::vector<NodeId> nodes;
        for (const NodeId id : touched) {
            Script now = reachOf(id);
            const auto before = scripts.find(id.value);
            count(referred, now.nodes, true, nodes);
            count(open, now.scopes, true, changedScopes);
            if (before != scripts.end()) {
                count(referred, before->second.nodes, false, nodes);
                count(open, before->second.scopes, false, changedScopes);
                scripts.erase(before);
            }
            if (!now.nodes.empty() || !now.scopes.empty()) scripts.emplace(id.value, std::move(now));
        }
        std::ranges::sort(changedScopes);
        changedScopes.erase(std::unique(changedScopes.begin(), changedScopes.end()), changedScopes.end());
        for (const NodeId id : nodes)
            if (const Node* node = scene->find(id)) passOn(*node);
        if (changedScopes.empty()) return;
        scene->forEachNode([&](const Node& node) {
            if (anyScope(node.scope(), [&](NodeId one) { return std::ranges::binary_search(changedScopes, one); }))
                passOn(node, false);
        });
    }
    /// A node has come into or left a script's hands: everything behind its fields is looked at anew.
    void passOn(const Node& node, bool report = true) {
        if (report) changedNodes.push_back(node.id());
        const TypeFacts& f = factsFor(node.typeIndex());
        const bool held = inHands(node);
        for (FieldIndex i = 0; i < f.held.size(); ++i) {
            if (!f.held[i]) continue;
            successors(node, i, held ? added : removed);
            if (!held) added.push_back({node.id(), i});
        }
    }

    void settle() {
        // Take back fields; they are examined again below.
        while (!removed.empty()) {
            const FieldRef one = removed.back();
            removed.pop_back();
            added.push_back(one);
            const Node* node = scene->find(one.node);
            if (!take(one.node, one.field) || !node) continue;
            if (!base(*node, factsFor(node->typeIndex()), one.field)) successors(*node, one.field, removed);
        }
        while (!added.empty()) {
            const FieldRef one = added.back();
            added.pop_back();
            const Node* node = scene->find(one.node);
            if (!node || active(*node, one.field) || !supported(*node, one.field)) continue;
            store(one.node, one.field);
            successors(*node, one.field, added);
        }
        std::ranges::sort(changedNodes);
        changedNodes.erase(std::unique(changedNodes.begin(), changedNodes.end()), changedNodes.end());
    }

    void rebuild() {
        for (const auto& [id, entry] : entries) changedNodes.push_back(NodeId{id});
        for (const auto& [id, n] : referred) changedNodes.push_back(NodeId{id});
        for (const auto& [id, n] : open) changedScopes.push_back(NodeId{id});
        facts.clear();
        entries.clear();
        scripts.clear();
        referred.clear();
        open.clear();
        std::vector<NodeId> touched;
        scene->forEachNode([&](const Node& node) {
            if (factsFor(node.typeIndex()).reaches) touched.push_back(node.id());
            for (const Route& route : scene->routesFrom(node.id()))
                if (active(node, route.fromField)) added.push_back({route.toNode, route.toField});
        });
        updateScripts(touched);
        settle();
    }

    void update(const ChangeSet& set) {
        std::vector<NodeId> touched;
        const auto reaches = [&](NodeId id) {
            const Node* node = scene->find(id);
            return node && factsFor(node->typeIndex()).reaches;
        };
        for (const Change& c : set.changes) {
            switch (c.kind) {
                case ChangeKind::createNode:
                    if (reaches(c.node)) touched.push_back(c.node);
                    break;
                case ChangeKind::setField:
                    if ((sf(c.value.type()) == FieldType::SFNode || c.value.type() == FieldType::SFBool) &&
                        reaches(c.node))
                        touched.push_back(c.node);
                    break;
                case ChangeKind::insertChild:
                case ChangeKind::removeChild:
                    if (reaches(c.node)) touched.push_back(c.node);
                    break;
                case ChangeKind::addRoute:
                case ChangeKind::removeRoute:
                    (c.kind == ChangeKind::addRoute ? added : removed).push_back({c.other, c.field2()});
                    if (reaches(c.other)) touched.push_back(c.other);
                    break;
                case ChangeKind::destroyNode:
                    if (scripts.contains(c.node.value)) touched.push_back(c.node);
                    if (entries.erase(c.node.value)) changedNodes.push_back(c.node);
                    break;
                case ChangeKind::defineType:
                case ChangeKind::setName:
                case ChangeKind::event:
                    break;
            }
        }
        updateScripts(touched);
        if (!removed.empty() || !added.empty() || !changedNodes.empty()) settle();
    }
};

Mobility::Mobility() : state_(std::make_unique<State>()) {}
Mobility::~Mobility() = default;

bool Mobility::mayChange(const Node& node, FieldIndex field) const {
    return state_->scene && state_->active(node, field);
}

AspectMask Mobility::mayChange(const Node& node) const {
    State& s = *state_;
    AspectMask mask = 0;
    if (!s.scene) return mask;
    const NodeType& type = node.type();
    const auto add = [&](FieldIndex i) {
        if (type.fields[i].readable()) mask = static_cast<AspectMask>(mask | aspectBit(type.fields[i].aspect));
    };
    const TypeFacts& f = s.factsFor(node.typeIndex());
    if (f.acts == Acts::always || s.inHands(node)) {
        for (FieldIndex i = 0; i < type.fields.size(); ++i)
            if (s.base(node, f, i)) add(i);
    }
    if (const auto entry = s.entries.find(node.id().value); entry != s.entries.end())
        for (const FieldIndex i : entry->second.reached) add(i);
    return mask;
}

std::span<const NodeId> Mobility::changedNodes() const {
    return state_->changedNodes;
}
std::span<const NodeId> Mobility::changedScopes() const {
    return state_->changedScopes;
}

Result<> Mobility::apply(const Scene& scene, const ChangeSet& changes) {
    State& s = *state_;
    s.changedNodes.clear();
    s.changedScopes.clear();
    const bool anew = s.scene != &scene || changes.isSnapshot();
    s.scene = &scene;
    if (anew)
        s.rebuild();
    else
        s.update(changes);
    return {};
}

}  // namespace rtsg
