// Finds what takes a change back, does it where nobody has changed the same since, and bounds the memory.
#include "edit_history.h"

#include <algorithm>
#include <ranges>
#include <unordered_set>
#include <utility>

#include <fmt/format.h>

#include "codec/node_label.h"
#include "columns/budget.h"
#include "edit.h"

namespace rtsg::mirror {

namespace {

constexpr std::uint64_t kItemCost = 256;  // bytes beside its values
constexpr std::size_t kMaxNamed = 3;      // of what was left unchanged

bool isReadable(const Node& node, FieldIndex field) {
    return field < node.type().fields.size() && node.type().fields[field].readable();
}

std::string label(const Scene& scene, NodeId node, FieldIndex field) {
    const Node* found = scene.find(node);
    if (!found || field >= found->type().fields.size()) return nodeLabel(scene, node);
    return fmt::format("{}.{}", nodeLabel(scene, node), found->type().fields[field].name);
}

/// The list of children; empty if there is none.
Array<NodeId> childrenOf(const Scene& scene, const Change& c) {
    const Node* parent = scene.find(c.node);
    if (!parent || !isReadable(*parent, c.field) || parent->type().fields[c.field].type != FieldType::MFNode) return {};
    return parent->get(Field<Array<NodeId>>{c.field});
}

/// The place of the child now: where it was, or else the first place.
std::size_t indexOf(const Scene& scene, const Change& c) {
    const Array<NodeId> children = childrenOf(scene, c);
    if (c.index < children.size() && children[c.index] == c.other) return c.index;
    return static_cast<std::size_t>(std::ranges::find(children, c.other) - children.begin());
}

/// How often the child is in that list.
Value countOf(const Scene& scene, const Change& c) {
    return static_cast<std::int32_t>(std::ranges::count(childrenOf(scene, c), c.other));
}

bool isRoute(const Scene& scene, const Change& c) {
    if (!scene.find(c.node) || !scene.find(c.other)) return false;
    return std::ranges::any_of(scene.routesFrom(c.node), [&](const Route& r) {
        return r.fromField == c.field && r.toNode == c.other && r.toField == c.field2();
    });
}

/// The value without references to nodes that are gone.
Value onlyWhatIsThere(const Scene& scene, const Value& value) {
    if (value.holds<NodeId>()) return scene.find(value.as<NodeId>()) ? value : Value(NodeId{});
    if (!value.holds<Array<NodeId>>()) return value;
    Array<NodeId> there;
    for (const NodeId id : value.as<Array<NodeId>>())
        if (scene.find(id)) there.push_back(id);
    return Value(std::move(there));
}

}  // namespace

// ---- finding what takes a change back ----------------------------------------------------------------------------

std::shared_ptr<const EditHistory::Lost> EditHistory::remember(const Scene& scene, NodeId id) {
    const Node& node = scene.node(id);
    auto lost = std::make_shared<Lost>();
    lost->type = node.typeIndex();
    lost->name = scene.name(id);
    for (FieldIndex i = 0; i < node.type().fields.size(); ++i) {
        const FieldDef& def = node.type().fields[i];
        if (def.readable() && !def.hidden && def.access != Access::outputOnly && !node.isDefault(i))
            lost->fields.emplace_back(i, node.value(i));
    }
    for (const ParentRef& p : scene.parents(id)) {
        const Node& parent = scene.node(p.node);
        const FieldDef& def = parent.type().fields[p.field];
        if (def.hidden || !def.readable() || def.access == Access::outputOnly) continue;
        Change link = changeOf(ChangeKind::setField, p.node, p.field);
        if (def.type == FieldType::MFNode) {
            link.kind = ChangeKind::insertChild;
            const auto& children = parent.get(Field<Array<NodeId>>{p.field});
            link.index = static_cast<std::uint32_t>(std::ranges::find(children, id) - children.begin());
        }
        lost->links.push_back(std::move(link));
    }
    for (const auto& routes : {scene.routesFrom(id), scene.routesTo(id)})
        for (const Route& route : routes)
            if (!route.isConnection) lost->routes.push_back(route);
    return lost;
}

void EditHistory::before(const Scene& scene, const Change& c) {
    mark_ = pending_.size();
    const Node* node = scene.find(c.node);
    const auto add = [&](Change back) { pending_.push_back({std::move(back), {}, nullptr}); };
    switch (c.kind) {
        case ChangeKind::setField:
            if (node && isReadable(*node, c.field))
                add(changeOf(ChangeKind::setField, c.node, c.field, node->value(c.field)));
            return;
        case ChangeKind::insertChild:
        case ChangeKind::removeChild: {
            Change back = c;
            back.kind = c.kind == ChangeKind::insertChild ? ChangeKind::removeChild : ChangeKind::insertChild;
            return add(std::move(back));
        }
        case ChangeKind::setName:
            // The name may be taken from another node.
            if (const NodeId holder = c.value.holds<String>() && node
                                          ? scene.findName(c.value.as<String>().view(), node->scope())
                                          : NodeId{};
                holder && holder != c.node)
                add(changeOf(ChangeKind::setName, holder, kNoField, c.value));
            return add(changeOf(ChangeKind::setName, c.node, kNoField, String(scene.name(c.node))));
        case ChangeKind::addRoute:
        case ChangeKind::removeRoute: {
            const bool there = isRoute(scene, c);
            if (there == (c.kind == ChangeKind::addRoute)) return;  // it changes nothing
            Change back = c;
            back.kind = there ? ChangeKind::addRoute : ChangeKind::removeRoute;
            return add(std::move(back));
        }
        case ChangeKind::createNode:
            return add(changeOf(ChangeKind::destroyNode, {}));
        case ChangeKind::destroyNode:
            if (!node) return;
            add(changeOf(ChangeKind::createNode, c.node));
            pending_.back().lost = remember(scene, c.node);
            return;
        case ChangeKind::defineType:
        case ChangeKind::event:
            return;
    }
}

void EditHistory::after(const Scene& scene, NodeId created) {
    for (std::size_t i = mark_; i < pending_.size(); ++i) {
        Item& item = pending_[i];
        if (item.back.kind == ChangeKind::destroyNode && !item.back.node) item.back.node = created;
        const Node* node = scene.find(item.back.node);
        if (item.back.kind == ChangeKind::setField && node) item.left = node->value(item.back.field);
        if (item.back.kind == ChangeKind::setName && node) item.left = String(scene.name(item.back.node));
        if (item.back.kind == ChangeKind::insertChild || item.back.kind == ChangeKind::removeChild)
            item.left = countOf(scene, item.back);
    }
}

void EditHistory::push(std::deque<Step>& steps, MirrorUpstream permission) {
    Step step;
    step.items = std::exchange(pending_, {});
    if (step.items.empty()) return;
    step.number = ++steps_;
    step.permission = permission;
    for (const Item& item : step.items) {
        step.bytes += kItemCost + wire::costOf(item.back.value) + wire::costOf(item.left);
        if (!item.lost) continue;
        step.bytes += kItemCost * (item.lost->links.size() + item.lost->routes.size());
        for (const auto& [field, value] : item.lost->fields) step.bytes += kItemCost + wire::costOf(value);
    }
    bytes_ += step.bytes;
    steps.push_back(std::move(step));
}

void EditHistory::end(std::string_view author, MirrorUpstream permission) {
    if (pending_.empty()) return;
    Author& one = authors_.try_emplace(std::string(author)).first->second;
    push(one.done, permission);
    for (const Step& step : one.undone) bytes_ -= step.bytes;
    one.undone.clear();
    one.used = steps_;
    forget();
}

/// Forgets the oldest steps of an author who has too many, or of all. Authors who were away for longest come first.
void EditHistory::forget() {
    const auto drop = [&](std::deque<Step>& steps) {
        bytes_ -= steps.front().bytes;
        steps.pop_front();
    };
    for (auto& [name, author] : authors_)
        for (std::deque<Step>* steps : {&author.done, &author.undone})
            while (steps->size() > kMaxSteps) drop(*steps);
    while (bytes_ > kMaxBytes) {
        std::deque<Step>* oldest = nullptr;
        for (auto& [name, author] : authors_)
            for (std::deque<Step>* steps : {&author.done, &author.undone})
                if (!steps->empty() && (!oldest || steps->front().number < oldest->front().number)) oldest = steps;
        if (!oldest) break;
        drop(*oldest);
    }
    while (authors_.size() > kMaxAuthors) {
        const auto first = std::ranges::min_element(authors_, {}, [](const auto& entry) { return entry.second.used; });
        for (const std::deque<Step>* steps : {&first->second.done, &first->second.undone})
            for (const Step& step : *steps) bytes_ -= step.bytes;
        authors_.erase(first);
    }
}

// ---- taking back -------------------------------------------------------------------------------------------------

/// Looked up once for a step, so that the cost of a long step is proportional to its length.
struct EditHistory::Taking {
    std::unordered_set<std::uint32_t> fresh;    // nodes that the step has created
    std::unordered_set<std::uint32_t> touched;  // those of them that others have worked on since
    Renamed renamed;                            // nodes that have come back so far
};

EditHistory::Taking EditHistory::look(const Step& step, std::string_view author) const {
    Taking taking;
    for (const Item& item : step.items)
        if (item.back.kind == ChangeKind::destroyNode) taking.fresh.insert(item.back.node.value);
    if (taking.fresh.empty()) return taking;
    for (const auto& [name, other] : authors_) {
        if (name == author) continue;
        for (const Step& later : other.done) {
            if (later.number < step.number) continue;
            for (const Item& item : later.items)
                for (const NodeId id : {item.back.node, item.back.other})
                    if (taking.fresh.contains(id.value)) taking.touched.insert(id.value);
        }
    }
    return taking;
}

/// Why a change is not taken back. Empty if it may be.
std::string EditHistory::whyKept(const Scene& scene, const Item& item, const Taking& taking) {
    const Change& c = item.back;
    if (item.lost) return {};  // the node is gone, so nobody else can have changed it
    const Node* node = scene.find(c.node);
    if (!node) return fmt::format("{} is gone", nodeLabel(scene, c.node));
    // A new node that others have worked on stays, with everything that belongs to it.
    for (const NodeId id : {c.node, c.other})
        if (taking.touched.contains(id.value)) return fmt::format("others have worked on {}", nodeLabel(scene, id));
    if (c.kind == ChangeKind::destroyNode && !item.cameBack && !scene.parents(c.node).empty())
        return fmt::format("{} is used elsewhere", nodeLabel(scene, c.node));
    const auto changed = [&] { return label(scene, c.node, c.field) + " was changed since"; };
    switch (c.kind) {
        case ChangeKind::setField:
            return isReadable(*node, c.field) && node->value(c.field) == item.left ? std::string() : changed();
        case ChangeKind::setName:
            return item.left.holds<String>() && scene.name(c.node) == item.left.as<String>().view()
                       ? std::string()
                       : fmt::format("{} was renamed since", nodeLabel(scene, c.node));
        case ChangeKind::removeChild:
        case ChangeKind::insertChild:
            if (!scene.find(c.other)) return fmt::format("{} is gone", nodeLabel(scene, c.other));
            return countOf(scene, c) == item.left ? std::string() : changed();
        case ChangeKind::addRoute:
            return scene.find(c.other) ? std::string() : fmt::format("{} is gone", nodeLabel(scene, c.other));
        default:
            return {};
    }
}

/// The newest step that is not passed over; the end if there is none.
EditHistory::Steps::iterator EditHistory::choose(const Scene& scene, Steps& from, std::string_view author) {
    for (auto step = from.end(); step != from.begin();) {
        --step;
        if (!step->passed) return step;
        const Taking taking = look(*step, author);
        if (std::ranges::any_of(step->items, [&](const Item& i) { return whyKept(scene, i, taking).empty(); }))
            return step;
    }
    return from.end();
}

/// Puts a step back among the others, which are ordered by their numbers.
void EditHistory::giveBack(Steps& from, Step step) {
    bytes_ += step.bytes;
    from.insert(std::ranges::upper_bound(from, step.number, {}, &Step::number), std::move(step));
    while (std::ranges::count(from, true, &Step::passed) > std::ptrdiff_t{kMaxPassed}) {
        const auto oldest = std::ranges::find(from, true, &Step::passed);
        bytes_ -= oldest->bytes;
        from.erase(oldest);
    }
}

Result<> EditHistory::carryOut(Scene& scene, Item item, std::string_view author) {
    Change& c = item.back;
    if (c.kind == ChangeKind::removeChild) c.index = static_cast<std::uint32_t>(indexOf(scene, c));
    before(scene, c);
    auto done = edit(scene, c, author);
    if (!done) {
        failed();
        return done;
    }
    after(scene);
    return done;
}

/// Creates a new node like the destroyed one, in the places that still exist.
Result<> EditHistory::bringBack(Scene& scene, const Item& item, std::string_view author, Renamed& renamed) {
    const NodeId id = scene.createNode(item.lost->type);
    if (!id) return fail(fmt::format("no {} could be created", scene.type(item.lost->type).name));
    renamed[item.back.node.value] = id;
    Item own = item;
    rename(own, renamed);  // a route may lead back to the same node
    pending_.push_back({changeOf(ChangeKind::destroyNode, id), {}, nullptr, true});
    const Lost& lost = *own.lost;
    for (const auto& [field, value] : lost.fields) (void)scene.setField(id, field, onlyWhatIsThere(scene, value));
    if (!lost.name.empty() && !scene.findName(lost.name)) (void)scene.setName(id, lost.name);
    for (const Change& link : lost.links) {
        const Node* parent = scene.find(link.node);
        if (!parent || !isReadable(*parent, link.field)) continue;
        Result<> back;
        if (link.kind == ChangeKind::insertChild)
            back = scene.insertChild(link.node, link.field, id, link.index);
        else if (parent->value(link.field) == Value(NodeId{}))
            back = scene.setField(link.node, link.field, Value(id));
        else
            continue;  // somebody has put another node there
        if (back) scene.attribute(author, link.node, link.field);
    }
    for (const Route& r : lost.routes)
        if (scene.find(r.fromNode) && scene.find(r.toNode))
            (void)scene.addRoute(r.fromNode, r.fromField, r.toNode, r.toField);
    scene.attribute(author, id);
    return {};
}

void EditHistory::rename(Item& item, const Renamed& renamed) {
    const auto in = [&](NodeId& id) {
        if (const auto found = renamed.find(id.value); found != renamed.end()) id = found->second;
    };
    const auto inValue = [&](Value& value) {
        if (value.holds<NodeId>()) {
            NodeId id = value.as<NodeId>();
            in(id);
            value = id;
        }
        if (!value.holds<Array<NodeId>>()) return;
        const Array<NodeId>& given = value.as<Array<NodeId>>();
        if (std::ranges::none_of(given, [&](NodeId id) { return renamed.contains(id.value); })) return;
        Array<NodeId> ids = given;
        std::for_each(ids.mutableData(), ids.mutableData() + ids.size(), in);
        value = std::move(ids);
    };
    in(item.back.node);
    in(item.back.other);
    inValue(item.back.value);
    inValue(item.left);
    if (!item.lost) return;
    Lost lost = *item.lost;
    for (auto& [field, value] : lost.fields) inValue(value);
    for (Change& link : lost.links) in(link.node);
    for (Route& route : lost.routes) in(route.fromNode), in(route.toNode);
    item.lost = std::make_shared<const Lost>(std::move(lost));
}

/// Uses the new numbers in the whole history.
void EditHistory::rename(const Renamed& renamed) {
    if (renamed.empty()) return;
    const auto in = [&](Item& item) { rename(item, renamed); };
    for (auto& [name, author] : authors_)
        for (std::deque<Step>* steps : {&author.done, &author.undone})
            for (Step& step : *steps) std::ranges::for_each(step.items, in);
    std::ranges::for_each(pending_, in);
}

Result<std::string> EditHistory::takeBack(Scene& scene, std::string_view author, bool again, MirrorUpstream permission,
                                          const NodeLocks& locks) {
    const auto found = authors_.find(author);
    if (found == authors_.end() || (again ? found->second.undone : found->second.done).empty())
        return fail(again ? "there is nothing to do again" : "there is nothing to take back");
    Steps& from = again ? found->second.undone : found->second.done;
    const auto chosen = choose(scene, from, author);
    if (chosen == from.end()) return fail("others have changed since what is left to take back");
    if (chosen->permission > permission) return fail("what was done then takes a permission that this peer lacks");
    Step step = std::move(*chosen);
    from.erase(chosen);
    bytes_ -= step.bytes;
    found->second.used = ++steps_;

    std::vector<std::string> kept;
    std::size_t done = 0, more = 0;
    bool waits = false;
    Taking taking = look(step, author);
    const auto now = locks.now();
    const auto isLocked = [&](const Item& item) {
        std::string why = locks.refusal(scene, item.back, author, now);
        if (!item.lost) return why;
        for (const Change& link : item.lost->links)
            if (why.empty()) why = locks.refusal(scene, link.node, author, now);
        for (const Route& route : item.lost->routes)
            for (const NodeId end : {route.fromNode, route.toNode})
                if (why.empty()) why = locks.refusal(scene, end, author, now);
        return why;
    };
    for (Item& item : std::views::reverse(step.items)) {
        if (!taking.renamed.empty()) rename(item, taking.renamed);
        std::string why = whyKept(scene, item, taking);
        if (why.empty()) waits |= !(why = isLocked(item)).empty();
        if (why.empty()) {
            const auto ok = item.lost ? bringBack(scene, item, author, taking.renamed) : carryOut(scene, item, author);
            if (ok)
                ++done;
            else
                why = ok.error().text;
        }
        if (why.empty() || std::ranges::find(kept, why) != kept.end()) continue;
        kept.size() < kMaxNamed ? kept.push_back(std::move(why)) : void(++more);
    }
    rename(taking.renamed);
    push(again ? found->second.done : found->second.undone, step.permission);
    forget();
    std::string text = fmt::format("{}", fmt::join(kept, "; "));
    if (more > 0) text += fmt::format("; and {} more", more);
    if (done > 0) return text;
    step.passed = !waits;  // for the end of a lock
    giveBack(from, std::move(step));
    return fail(text);
}

}  // namespace rtsg::mirror
