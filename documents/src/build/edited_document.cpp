// Carries the edits of a document over to the scene that was loaded from it.
#include <rtsg/documents/edited_document.h>

#include <algorithm>
#include <string>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "commands/document_head.h"
#include "document_match.h"
#include "proto.h"

namespace rtsg {

namespace {

/// A NodeType cannot be copied, and one that a scene knows is that scene's.
std::shared_ptr<const NodeType> copyOf(const NodeType& type, std::string name) {
    auto copy = std::make_shared<NodeType>();
    copy->name = std::move(name);
    copy->component = type.component;
    copy->level = type.level;
    copy->kind = type.kind;
    copy->containerField = type.containerField;
    copy->implements = type.implements;
    copy->fields = type.fields;
    copy->internal = type.internal;
    copy->since = type.since;
    copy->acts = type.acts;
    copy->writesInputs = type.writesInputs;
    copy->role = type.role;
    copy->below = type.below;
    copy->declaration = type.declaration;
    return copy->finish() ? copy : nullptr;
}

/// The changes to a list of nodes. `removed`: indices in the old list; `kept`: for each index in the new list, whether
/// the node was there in this order.
struct ListEdit {
    std::vector<std::size_t> removed;
    std::vector<NodeId> after;
    std::vector<bool> kept;

    std::size_t count() const { return removed.size() + static_cast<std::size_t>(std::ranges::count(kept, false)); }
    std::vector<NodeId> keptNodes() const {
        std::vector<NodeId> result;
        for (std::size_t i = 0; i < after.size(); ++i)
            if (kept[i]) result.push_back(after[i]);
        return result;
    }
};

/// Both of nodes of the scene; new ones of `after` may stand in no `before`.
ListEdit editOf(const std::vector<NodeId>& before, std::vector<NodeId> after) {
    ListEdit edit;
    edit.kept.resize(after.size());
    // The longest run that stands in both in the same order, as of the pairs of their places.
    std::unordered_map<std::uint32_t, std::vector<std::size_t>> indices;
    for (std::size_t i = before.size(); i-- > 0;) indices[before[i].value].push_back(i);
    struct Candidate {
        std::size_t before, after, previous;
    };
    std::vector<Candidate> candidates;
    std::vector<std::size_t> ends;
    for (std::size_t i = 0; i < after.size(); ++i) {
        const auto found = indices.find(after[i].value);
        if (found == indices.end() || found->second.empty()) continue;
        const std::size_t index = found->second.back();
        found->second.pop_back();
        const auto at = std::ranges::lower_bound(ends, index, {}, [&](std::size_t c) { return candidates[c].before; });
        candidates.push_back({index, i, at == ends.begin() ? SIZE_MAX : *std::prev(at)});
        if (at == ends.end())
            ends.push_back(candidates.size() - 1);
        else
            *at = candidates.size() - 1;
    }
    std::vector<bool> stays(before.size());
    for (std::size_t c = ends.empty() ? SIZE_MAX : ends.back(); c != SIZE_MAX; c = candidates[c].previous)
        stays[candidates[c].before] = edit.kept[candidates[c].after] = true;
    for (std::size_t i = 0; i < before.size(); ++i)
        if (!stays[i]) edit.removed.push_back(i);
    edit.after = std::move(after);
    return edit;
}

}  // namespace

struct EditedDocument::State {
    Scene& scene;
    std::unique_ptr<Scene> document;  // as it was read last
    std::vector<NodeId> nodes;        // of the scene, by number of the document's node

    class Edits;
};

/// One version of the document becomes the next.
class EditedDocument::State::Edits {
  public:
    Edits(State& state, const Scene& after, Diagnostics& diagnostics)
        : scene_(state.scene),
          before_(*state.document),
          after_(after),
          match_(before_, after_),
          liveBefore_(state.nodes),
          types_(after.typeCount()),
          diagnostics_(diagnostics) {
        std::uint32_t last = 0;
        after_.forEachNode([&](const Node& node) { last = node.id().value; });
        live_.resize(std::size_t{last} + 1);
    }

    void carryOut() {
        defineTypes();
        createNodes();
        eachPair([&](const Node& b, const Node& a) { removeNodes(b, a); });
        removeRoutes();
        destroyNodes();
        eachPair([&](const Node& b, const Node& a) { setValues(b, a); });
        setNames();
        for (const NodeId id : news_) putNodes(nullptr, after_.node(id));
        eachPair([&](const Node& b, const Node& a) { putNodes(&b, a); });
        addRoutes();
        after_.forEachNode([&](const Node& a) {
            if (const NodeLocation location = after_.locationOf(a.id()); location.where.line && isThere(liveOf(a.id())))
                scene_.setLocation(liveOf(a.id()), location);
        });
    }
    std::vector<NodeId> takeLive() { return std::move(live_); }

  private:
    template <class Visit>
    void eachPair(const Visit& visit) {
        after_.forEachNode([&](const Node& a) {
            const NodeId b = match_.before(a.id());
            if (b && isThere(liveOf(a.id()))) visit(before_.node(b), a);
        });
    }
    /// Whether the scene's document declares this one of the prototypes of its name.
    bool isSaved(TypeIndex type) const {
        const std::vector<const NodeType*> all = declaredTypes(scene_);
        return std::ranges::find(all, &scene_.type(type)) != all.end();
    }
    bool isThere(NodeId live) const { return live && scene_.find(live); }
    NodeId liveOf(NodeId after) const { return live_[after.value]; }
    /// The scene's node for one of the document before; none: it is gone.
    NodeId liveBefore(NodeId before) const {
        return before.value < liveBefore_.size() ? liveBefore_[before.value] : NodeId{};
    }
    void report(const Result<>& done, const Node& about) {
        if (done) return;
        const NodeLocation location = after_.locationOf(about.id());
        diagnostics_.warningAt(location, fmt::format("an edit of {} {} is left out: {}", about.type().name,
                                                     after_.name(about.id()), done.error().text));
    }
    /// Nodes of the scene: those of the document that are there.
    std::vector<NodeId> liveNodes(const Node& a, FieldIndex field) const {
        std::vector<NodeId> all = nodesIn(a, field);
        for (NodeId& id : all) id = liveOf(id);
        std::erase_if(all, [&](NodeId id) { return !isThere(id); });
        return all;
    }
    std::vector<NodeId> liveNodesBefore(const Node& b, FieldIndex field) const {
        std::vector<NodeId> all = nodesIn(b, field);
        for (NodeId& id : all) id = liveBefore(id);
        return all;
    }

    void defineTypes();
    void createNodes();
    void removeNodes(const Node& b, const Node& a);
    void removeRoutes();
    void destroyNodes();
    void setValues(const Node& b, const Node& a);
    void setNames();
    void putNodes(const Node* b, const Node& a);
    void addRoutes();
    void change(const Node& a, FieldIndex field, const std::vector<NodeId>& wanted);

    Scene& scene_;
    const Scene &before_, &after_;
    const DocumentMatch match_;
    const std::vector<NodeId>& liveBefore_;
    std::vector<NodeId> live_;      // by number of the node after
    std::vector<NodeId> news_;      // nodes after
    std::vector<TypeIndex> types_;  // of the scene, by number of the type after
    Diagnostics& diagnostics_;
};

void EditedDocument::State::Edits::defineTypes() {
    std::vector<bool> isUsed(types_.size());
    after_.forEachNode([&](const Node& a) { isUsed[a.typeIndex().value] = true; });
    for (std::size_t i = 0; i < types_.size(); ++i) {
        types_[i] = TypeIndex{static_cast<std::uint16_t>(i)};
        if (i < builtinTypes().size()) continue;
        const NodeType& wanted = after_.type(types_[i]);
        types_[i] = {};
        for (std::size_t k = builtinTypes().size(); k < scene_.typeCount() && types_[i] == TypeIndex(); ++k)
            if (isSameType(scene_.type(TypeIndex{static_cast<std::uint16_t>(k)}), wanted))
                types_[i] = TypeIndex{static_cast<std::uint16_t>(k)};
        // A prototype without instances is saved if it is the last of its name: one that comes back is the last again.
        if (types_[i] != TypeIndex() && (isUsed[i] || wanted.declaration.empty() || isSaved(types_[i]))) continue;
        const std::string name(nameInDocument(wanted));
        std::string free = name;
        const bool hasOwnName = wanted.kind != NodeType::Kind::script;  // Scripts are all called Script
        for (int copy = 2; hasOwnName && scene_.findType(free); ++copy) free = fmt::format("{}#{}", name, copy);
        const auto defined = scene_.defineType(copyOf(wanted, free));
        if (defined)
            types_[i] = *defined;
        else
            diagnostics_.error({}, fmt::format("{}: {}", name, defined.error().text));
    }
}

/// Scopes have smaller numbers than their nodes.
void EditedDocument::State::Edits::createNodes() {
    after_.forEachNode([&](const Node& a) {
        NodeId& live = live_[a.id().value];
        if (const NodeId b = match_.before(a.id())) {
            live = liveBefore(b);
            return;
        }
        const NodeId scope = a.scope() ? liveOf(a.scope()) : NodeId{};
        if (a.scope() && !isThere(scope)) return;  // the scene has destroyed the instance or the Inline
        live = scene_.createNode(types_[a.typeIndex().value], scope);
        if (!live) return diagnostics_.error(after_.locationOf(a.id()).where, "no node could be created here");
        news_.push_back(a.id());
        for (FieldIndex i = 0; i < a.type().fields.size(); ++i) {
            const FieldDef& def = a.type().fields[i];
            if (sf(def.type) == FieldType::SFNode || !isOfDocument(a.type(), def) || a.isDefault(i)) continue;
            report(scene_.setField(live, i, a.value(i)), a);
        }
    });
}

/// In this way a node never comes to stand below itself while others move.
void EditedDocument::State::Edits::removeNodes(const Node& b, const Node& a) {
    for (const FieldIndex field : a.type().nodeFields()) {
        const FieldDef& def = a.type().fields[field];
        if (!isOfDocument(a.type(), def)) continue;
        const std::vector<NodeId> before = liveNodesBefore(b, field);
        const ListEdit edit = editOf(before, liveNodes(a, field));
        if (edit.removed.empty()) continue;
        std::vector<NodeId> wanted = nodesIn(scene_.node(liveOf(a.id())), field);
        if (wanted == before) {
            change(a, field, edit.keptNodes());
            continue;
        }
        for (const std::size_t index : edit.removed)
            if (const auto found = std::ranges::find(wanted, before[index]); found != wanted.end()) wanted.erase(found);
        change(a, field, wanted);
    }
}

/// Sets the nodes of a field of the scene's node: one by one if they are few, so that subscribers get few.
void EditedDocument::State::Edits::change(const Node& a, FieldIndex field, const std::vector<NodeId>& wanted) {
    const NodeId id = liveOf(a.id());
    const Node& node = scene_.node(id);
    const std::vector<NodeId> now = nodesIn(node, field);
    if (now == wanted) return;
    if (node.type().fields[field].type == FieldType::SFNode)
        return report(scene_.setField(id, field, Value(wanted.empty() ? NodeId{} : wanted.front())), a);
    const ListEdit edit = editOf(now, wanted);
    if (edit.count() * 2 > std::max(now.size(), wanted.size()))
        return report(scene_.setField(id, field, Value(Array<NodeId>(std::span<const NodeId>(wanted)))), a);
    for (std::size_t i = edit.removed.size(); i-- > 0;) report(scene_.removeChild(id, field, edit.removed[i]), a);
    for (std::size_t i = 0; i < wanted.size(); ++i)
        if (!edit.kept[i]) report(scene_.insertChild(id, field, wanted[i], i), a);
}

void EditedDocument::State::Edits::removeRoutes() {
    before_.forEachNode([&](const Node& b) {
        const NodeId from = liveBefore(b.id());
        const NodeId a = match_.after(b.id());
        if (!a || !isThere(from)) return;  // it takes its routes with it
        const std::vector<Route> now = after_.routesFrom(a);
        for (const Route& route : before_.routesFrom(b.id())) {
            const NodeId to = match_.after(route.toNode), live = liveBefore(route.toNode);
            if (route.isConnection || !to || !isThere(live)) continue;
            if (std::ranges::find(now, Route{a, route.fromField, to, route.toField}) != now.end()) continue;
            (void)scene_.removeRoute(from, route.fromField, live, route.toField);  // a script may have been before us
        }
    });
}

void EditedDocument::State::Edits::destroyNodes() {
    before_.forEachNode([&](const Node& b) {
        const NodeId live = liveBefore(b.id());
        if (match_.after(b.id()) || !isThere(live) || scene_.isHeld(live)) return;
        (void)scene_.destroyNode(live);
    });
}

void EditedDocument::State::Edits::setValues(const Node& b, const Node& a) {
    for (FieldIndex i = 0; i < a.type().fields.size(); ++i) {
        const FieldDef& def = a.type().fields[i];
        if (sf(def.type) == FieldType::SFNode || !isOfDocument(a.type(), def)) continue;
        if (equalStorage(def.type, a.storage(i), b.storage(i))) continue;
        const NodeId live = liveOf(a.id());
        if (!equalStorage(def.type, a.storage(i), scene_.node(live).storage(i)))
            report(scene_.setField(live, i, a.value(i)), a);
    }
}

void EditedDocument::State::Edits::setNames() {
    eachPair([&](const Node& b, const Node& a) {
        const std::string_view name = after_.name(a.id());
        if (name != before_.name(b.id()) && name != scene_.name(liveOf(a.id())))
            report(scene_.setName(liveOf(a.id()), name), a);
    });
    for (const NodeId id : news_)
        if (!after_.name(id).empty()) report(scene_.setName(liveOf(id), after_.name(id)), after_.node(id));
}

/// `b` is null for a new node.
void EditedDocument::State::Edits::putNodes(const Node* b, const Node& a) {
    for (const FieldIndex field : a.type().nodeFields()) {
        if (!isOfDocument(a.type(), a.type().fields[field])) continue;
        const ListEdit edit = editOf(b ? liveNodesBefore(*b, field) : std::vector<NodeId>(), liveNodes(a, field));
        if (edit.count() == 0) continue;
        const Node& live = scene_.node(liveOf(a.id()));
        std::vector<NodeId> wanted = nodesIn(live, field);
        if (live.type().fields[field].type == FieldType::SFNode || wanted == edit.keptNodes()) {
            if (edit.count() > edit.removed.size()) change(a, field, edit.after);
            continue;
        }
        if (wanted == edit.after) continue;  // an IS connection has brought them
        // Each behind the one that it follows in the document, wherever the scene has that now.
        std::size_t at = 0;
        for (std::size_t i = 0; i < edit.after.size(); ++i) {
            const auto from = wanted.begin() + static_cast<std::ptrdiff_t>(at);
            if (!edit.kept[i]) {
                wanted.insert(from, edit.after[i]);
                ++at;
            } else if (const auto found = std::find(from, wanted.end(), edit.after[i]); found != wanted.end()) {
                at = static_cast<std::size_t>(found - wanted.begin()) + 1;
            }
        }
        change(a, field, wanted);
    }
}

void EditedDocument::State::Edits::addRoutes() {
    after_.forEachNode([&](const Node& a) {
        const NodeId b = match_.before(a.id());
        const std::vector<Route> then = b ? before_.routesFrom(b) : std::vector<Route>();
        for (const Route& route : after_.routesFrom(a.id())) {
            const NodeId to = match_.before(route.toNode);
            const NodeId from = liveOf(a.id()), live = liveOf(route.toNode);
            if (!isThere(from) || !isThere(live)) continue;
            if (b && to &&
                std::ranges::find(then, Route{b, route.fromField, to, route.toField, route.isConnection}) != then.end())
                continue;
            if (!route.isConnection)
                report(scene_.addRoute(from, route.fromField, live, route.toField), a);
            else if (after_.node(route.toNode).scope() == a.id())  // the other way comes with it
                report(scene_.addIsConnection(from, route.fromField, live, route.toField), a);
            else if (after_.type(after_.node(route.toNode).typeIndex()).fields[route.toField].access ==
                     Access::outputOnly)
                report(scene_.addIsConnection(live, route.toField, from, route.fromField), a);
        }
    });
}

// ---- the document
// ----------------------------------------------------------------------------------------------------

EditedDocument::EditedDocument(Scene& scene) : state_(std::make_unique<State>(scene)) {
    state_->document = std::make_unique<Scene>();
    const auto copied = state_->document->apply(std::make_shared<ChangeSet>(scene.snapshot()));
    RTSG_CHECK_EQ(copied ? std::string() : copied.error().text, std::string());
    scene.forEachNode([&](const Node& node) {
        state_->nodes.resize(std::size_t{node.id().value} + 1);
        state_->nodes.back() = node.id();
    });
}
EditedDocument::~EditedDocument() = default;

std::unique_ptr<Scene> EditedDocument::emptyScene() const {
    auto result = std::make_unique<Scene>();
    for (std::size_t i = builtinTypes().size(); i < state_->scene.typeCount(); ++i) {
        const NodeType& type = state_->scene.type(TypeIndex{static_cast<std::uint16_t>(i)});
        if (type.kind != NodeType::Kind::user) break;  // they come before those of documents
        (void)result->defineType(copyOf(type, type.name));
    }
    return result;
}

Result<> EditedDocument::follow(std::unique_ptr<Scene> edited, Diagnostics& diagnostics) {
    State& s = *state_;
    if (s.scene.isInFrame()) return fail(DiagnosticCode("from-within"), "a document is followed between two frames");
    State::Edits edits(s, *edited, diagnostics);
    edits.carryOut();
    s.nodes = edits.takeLive();
    s.document = std::move(edited);
    return {};
}

bool EditedDocument::followFile(const std::filesystem::path& file, Diagnostics& diagnostics,
                                const LoadOptions& options) {
    const std::size_t errors = diagnostics.errors();
    std::unique_ptr<Scene> edited = emptyScene();
    if (!loadFile(*edited, file, diagnostics, options) || diagnostics.errors() > errors) return false;
    if (auto ok = follow(std::move(edited), diagnostics); !ok) {
        diagnostics.add(std::move(ok.error()));
        return false;
    }
    return true;
}

std::vector<std::filesystem::path> EditedDocument::filesWithin(const Resources& resources) const {
    std::vector<std::filesystem::path> files;
    const Scene& document = *state_->document;
    const Resources local = resources.withoutNetwork();
    document.forEachNode([&](const Node& node) {
        const FieldIndex field = hiddenField(node.type(), "loadedUrl");
        if (field == kNoField || node.isDefault(field)) return;
        const auto file = local.open(local.folderOf(document, node.scope()), node.get(Field<String>{field}));
        if (file && !file->path().empty()) files.push_back(file->path());
    });
    std::ranges::sort(files);
    files.erase(std::ranges::unique(files).begin(), files.end());
    return files;
}

}  // namespace rtsg
