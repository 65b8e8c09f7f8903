// Answers and asks questions about hashes: from "something differs" to the fields that do, and their repair.
#include "questions.h"

#include <algorithm>
#include <bit>

#include <fmt/format.h>

#include "edit.h"

namespace rtsg::mirror {

namespace {

unsigned partBits(NodeRange range) {
    return std::min(range.bits, kFanOutBits);
}

void putHash(ByteBuffer& out, Hash128 hash) {
    out.put(hash.low);
    out.put(hash.high);
}
Hash128 readHash(wire::Reader& in) {
    Hash128 hash;
    hash.low = in.number<std::uint64_t>();
    hash.high = in.number<std::uint64_t>();
    return hash;
}

bool readRange(wire::Reader& in, NodeRange& range) {
    range.first = in.varint32();
    range.bits = static_cast<unsigned>(in.bounded(32));
    const std::uint64_t size = std::uint64_t{1} << range.bits;
    return !in.problem && range.first % size == 0;
}

void putRange(ByteBuffer& out, NodeRange range) {
    out.putVarint(range.first);
    out.putVarint(range.bits);
}

Change routeChange(ChangeKind kind, const Route& route) {
    Change change = changeOf(kind, route.fromNode);
    change.field = route.fromField;
    change.other = route.toNode;
    change.index = route.toField;
    change.isConnection = route.isConnection;
    return change;
}

Route routeOf(const Change& c) {
    return {c.node, c.field, c.other, c.field2(), bool(c.isConnection)};
}

}  // namespace

NodeRange wholeRange(const Scene& scene) {
    std::uint32_t last = 1;
    scene.forEachNode([&](const Node& node) { last = node.id().value; });
    return {0, static_cast<unsigned>(std::bit_width(last))};
}

std::vector<Hash128> partialSums(const Scene& scene, NodeRange range) {
    const unsigned parts = partBits(range), shift = range.bits - parts;
    std::vector<Hash128> sums(std::size_t{1} << parts);
    const std::uint64_t first = range.first, size = std::uint64_t{1} << range.bits;
    const auto add = [&](const Node& node) {
        const std::uint64_t at = node.id().value - first;
        if (node.id().value < first || at >= size) return;
        Hash128& sum = sums[at >> shift];
        sum = sum + hashOfNode(scene, node);
    };
    if (size >= scene.nodeCount()) {
        scene.forEachNode(add);
    } else {
        for (std::uint64_t id = first; id < first + size; ++id)
            if (const Node* node = scene.find(NodeId{static_cast<std::uint32_t>(id)})) add(*node);
    }
    return sums;
}

void askDoubt(ByteBuffer& out, std::uint64_t session, std::span<const NodeRange> ranges) {
    begin(out, Message::doubt);
    out.put(session);
    out.putVarint(ranges.size());
    for (const NodeRange range : ranges) putRange(out, range);
}

bool answerDoubt(const Scene& scene, std::uint64_t session, wire::Reader& in, ByteBuffer& out) {
    const std::size_t count = in.count(2);
    if (in.problem || count > kMaxRanges) return false;
    std::vector<NodeRange> ranges(count);
    for (NodeRange& range : ranges)
        if (!readRange(in, range)) return false;
    if (ranges.empty()) ranges.push_back(wholeRange(scene));
    const std::uint64_t numbers[] = {session, scene.sequence()};
    write(out, Message::digest, numbers);
    out.putVarint(ranges.size());
    for (const NodeRange range : ranges) {
        putRange(out, range);
        for (const Hash128 sum : partialSums(scene, range)) putHash(out, sum);
    }
    return true;
}

bool answerInspect(const Scene& scene, std::uint64_t session, wire::Reader& in, ByteBuffer& out) {
    const std::size_t count = in.count(1);
    if (in.problem || count > kMaxNodes) return false;
    std::vector<NodeId> nodes(count);
    for (NodeId& id : nodes) id = NodeId{in.varint32()};
    if (in.problem) return false;
    const std::uint64_t numbers[] = {session, scene.sequence()};
    write(out, Message::anatomy, numbers);
    for (const NodeId id : nodes) {
        const Node* node = scene.find(id);
        if (node && out.size() + 16 * (node->type().fields.size() + 4) > kLongestAnswer)
            break;  // some nodes are enough
        out.putVarint(id.value);
        out.put(static_cast<std::uint8_t>(node != nullptr));
        if (!node) continue;
        const NodeHashes hashes = hashesOf(scene, *node);
        for (const Hash128 hash : {hashes.node, hashes.name, hashes.routes}) putHash(out, hash);
        out.putVarint(hashes.fields.size());
        for (const Hash128 hash : hashes.fields) putHash(out, hash);
    }
    return true;
}

bool answerWant(const Scene& scene, wire::Reader& in, ChangeSet& out) {
    const std::size_t count = in.count(2);
    if (in.problem || count > kMaxWants) return false;
    std::vector<std::pair<NodeId, NodePart>> wants(count);
    for (auto& [id, part] : wants) {
        id = NodeId{in.varint32()};
        part = in.varint32();
        if (in.problem || part > kWholeNode) return false;
    }
    std::ranges::sort(wants);
    wants.erase(std::unique(wants.begin(), wants.end()), wants.end());  // an answer is never larger than the scene
    std::vector<Change> values, names, routes;
    out.clear();
    for (const auto& [id, part] : wants) {
        const Node* node = scene.find(id);
        if (!node) continue;
        const auto field = [&](FieldIndex index) {
            Change& change = values.emplace_back(changeOf(ChangeKind::setField, id));
            change.field = index;
            change.value = node->value(index);
        };
        if (part == kWholeNode) {
            Change& created = out.changes.emplace_back(changeOf(ChangeKind::createNode, id));
            created.index = node->typeIndex().value;
            created.other = node->scope();
            for (FieldIndex f = 0; f < node->type().fields.size(); ++f)
                if (node->type().fields[f].readable() && !node->isDefault(f)) field(f);
        } else if (part < node->type().fields.size() && node->type().fields[part].readable()) {
            field(static_cast<FieldIndex>(part));
        }
        if (part == kWholeNode || part == kNamePart)
            names.emplace_back(changeOf(ChangeKind::setName, id)).value = String(scene.name(id));
        if (part == kWholeNode || part == kRoutesPart)
            for (const Route& route : scene.routesFrom(id)) routes.push_back(routeChange(ChangeKind::addRoute, route));
    }
    for (std::vector<Change>* some : {&values, &names, &routes})
        out.changes.insert(out.changes.end(), std::make_move_iterator(some->begin()),
                           std::make_move_iterator(some->end()));
    out.from = out.to = scene.sequence();
    out.time = scene.now();
    out.hash = scene.hash();
    return true;
}

// ---- the side that asks ------------------------------------------------------------------------------------------

void Bisection::begin(std::uint64_t session, std::vector<NodeRange> ranges, ByteBuffer& question) {
    session_ = session;
    running_ = true;
    questions_ = 1;
    asked_ = std::move(ranges);
    suspects_.clear();
    extra_.clear();
    routes_.clear();
    found_.clear();
    askDoubt(question, session_, asked_);
}

void Bisection::differs(const Scene& replica, NodeId node, std::string field, std::string text) {
    const std::string_view name = replica.name(node);
    found_.push_back({replica.sequence(), replica.now(),
                      name.empty() ? fmt::format("#{}", node.value) : std::string(name), std::move(field),
                      std::move(text)});
}

Bisection::Step Bisection::digest(const Scene& replica, wire::Reader& in, ByteBuffer& question) {
    const std::size_t count = in.count(2);
    if (in.problem || count > kMaxRanges || (!asked_.empty() && count != asked_.size())) return Step::malformed;
    std::vector<NodeRange> next;
    for (std::size_t i = 0; i < count; ++i) {
        NodeRange range;
        if (!readRange(in, range)) return Step::malformed;
        const unsigned parts = partBits(range), shift = range.bits - parts;
        if (in.left() < (std::size_t{16} << parts)) return Step::malformed;
        const std::vector<Hash128> own = partialSums(replica, range);
        for (std::size_t k = 0; k < own.size(); ++k) {
            if (own[k] == readHash(in)) continue;
            const NodeRange part{range.first + static_cast<std::uint32_t>(k << shift), shift};
            if (shift == 0)
                suspects_.push_back(NodeId{part.first});
            else
                next.push_back(part);
        }
        // This replica has node numbers that the origin has not reached yet.
        if (asked_.empty() && range.bits < 32) {
            replica.forEachNode([&](const Node& node) {
                if (node.id().value >> range.bits) suspects_.push_back(node.id());
            });
        }
    }
    if (next.size() > kMaxRanges || suspects_.size() > kMaxNodes) return Step::hopeless;
    if (next.empty() && suspects_.empty()) return Step::same;
    ++questions_;
    if (!next.empty()) {
        asked_ = std::move(next);
        askDoubt(question, session_, asked_);
        return Step::ask;
    }
    mirror::begin(question, Message::inspect);
    question.put(session_);
    question.putVarint(suspects_.size());
    for (const NodeId id : suspects_) question.putVarint(id.value);
    return Step::ask;
}

Bisection::Step Bisection::anatomy(const Scene& replica, wire::Reader& in, ByteBuffer& question) {
    std::vector<std::pair<NodeId, NodePart>> wants;
    bool possible = true;
    while (in.left()) {
        const NodeId id{in.varint32()};
        const bool exists = in.number<std::uint8_t>() != 0;
        const Node* node = replica.find(id);
        if (in.problem || std::ranges::find(suspects_, id) == suspects_.end()) return Step::malformed;
        if (!exists) {
            if (!node) continue;
            differs(replica, id, "existence", "only here");
            extra_.push_back(id);
            continue;
        }
        NodeHashes theirs;
        for (Hash128* hash : {&theirs.node, &theirs.name, &theirs.routes}) *hash = readHash(in);
        theirs.fields.resize(in.count(16));
        for (Hash128& hash : theirs.fields) hash = readHash(in);
        if (in.problem) return Step::malformed;
        if (!node) {
            differs(replica, id, "existence", "missing here");
            wants.emplace_back(id, kWholeNode);
            continue;
        }
        const NodeHashes ours = hashesOf(replica, *node);
        if (ours.node != theirs.node || ours.fields.size() != theirs.fields.size()) {
            differs(replica, id, "type", "other type or scope");
            possible = false;
            continue;
        }
        for (FieldIndex f = 0; f < ours.fields.size(); ++f) {
            if (ours.fields[f] == theirs.fields[f]) continue;
            differs(replica, id, node->type().fields[f].name, "other value");
            wants.emplace_back(id, f);
        }
        if (ours.name != theirs.name) {
            differs(replica, id, "name", "other name");
            wants.emplace_back(id, kNamePart);
        }
        if (ours.routes != theirs.routes) {
            differs(replica, id, "routes", "other routes");
            wants.emplace_back(id, kRoutesPart);
            routes_.push_back(id);
        }
    }
    if (!possible || wants.size() > kMaxWants) return Step::hopeless;
    if (found_.empty()) return Step::same;
    ++questions_;
    mirror::begin(question, Message::want);
    question.put(session_);
    question.putVarint(wants.size());
    for (const auto& [id, part] : wants) {
        question.putVarint(id.value);
        question.putVarint(part);
    }
    return Step::ask;
}

void Bisection::complete(const Scene& replica, ChangeSet& set) const {
    std::vector<Route> gone;
    const auto remove = [&](const Route& route) {
        if (std::ranges::find(gone, route) == gone.end()) gone.push_back(route);
    };
    for (const NodeId id : routes_) {
        for (const Route& own : replica.routesFrom(id)) {
            const auto wanted = std::ranges::find_if(
                set.changes, [&](const Change& c) { return c.kind == ChangeKind::addRoute && routeOf(c) == own; });
            if (wanted == set.changes.end())
                remove(own);
            else
                set.changes.erase(wanted);
        }
    }
    for (const NodeId id : extra_) {
        if (!replica.find(id)) continue;
        for (const Route& route : replica.routesFrom(id)) remove(route);
        for (const Route& route : replica.routesTo(id)) remove(route);
    }
    for (const Route& route : gone) set.changes.push_back(routeChange(ChangeKind::removeRoute, route));
    for (const NodeId id : extra_)
        if (replica.find(id)) set.changes.push_back(changeOf(ChangeKind::destroyNode, id));
}

}  // namespace rtsg::mirror
