// Sends a scene as the commands of a document: declarations first, shared nodes once.
#include <rtsg/documents/scene_exporter.h>

#include <algorithm>
#include <optional>
#include <unordered_map>
#include <unordered_set>

#include <fmt/format.h>

#include <rtsg/core/resource.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/command_list.h>
#include <rtsg/documents/filter.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/read_document.h>

#include "builder_state.h"
#include "text/field_text_printer.h"

namespace rtsg {

namespace {

bool isInstance(const NodeType& type) {
    return type.kind == NodeType::Kind::proto || type.kind == NodeType::Kind::externProto;
}

/// Whether the url names a file by its way from the document: neither an address nor a script nor a part of it.
bool isRelative(std::string_view url) {
    if (url.empty() || url.starts_with('/') || url.starts_with('#')) return false;
    return std::min(url.find(':'), url.size()) >= std::min(url.find_first_of("/?#"), url.size());
}

/// Finds out which interface fields have nodes as their default.
class DeclarationScan final : public Filter {
  public:
    /// "Proto.field" for each such field of a declaration at the top of the document.
    std::unordered_set<std::string> nodeDefaults;

    void beginNode(std::string_view, std::string_view, std::string_view field, SourceLocation) override {
        if (nodes_++ == 0 && protos_ == 1 && !inBody_) nodeDefaults.insert(fmt::format("{}.{}", name_, field));
    }
    void endNode(SourceLocation) override { --nodes_; }
    void beginProto(std::string_view name, SourceLocation) override {
        if (protos_++ > 0) return;
        name_ = name;
        inBody_ = false;
    }
    void beginProtoBody(SourceLocation) override {
        if (protos_ == 1) inBody_ = true;
    }
    void endProto(SourceLocation) override { --protos_; }

  private:
    std::string name_;
    std::size_t nodes_ = 0, protos_ = 0;
    bool inBody_ = false;
};

/// Passes on the content of a document, without its beginning and end.
class Contents final : public Filter {
  public:
    using Filter::Filter;
    void beginDocument(const DocumentHeader&) override {}
    void endDocument() override {}
};

/// One node on the way from the root to where the walk is.
struct Position {
    const Node* node = nullptr;
    std::size_t field = 0, child = 0;
};

}  // namespace

struct SceneExporter::State {
    const Scene& scene;
    Diagnostics& diagnostics;
    ExportOptions options;
    std::unordered_map<std::uint32_t, std::uint32_t> seen;  // node -> times met
    std::unordered_map<std::uint32_t, std::string> given;   // names of ours
    std::vector<NodeId> order;                              // document order
    std::vector<NodeId> expanded;                           // instances that do not come out themselves
    std::vector<NodeId> hidden;                             // nodes of expanded bodies that are not shown
    std::vector<Route> routes;                              // between nodes of the document
    DeclarationScan declarations;
    std::vector<const NodeType*> declared;               // the document's own prototypes
    std::unordered_map<std::string, NodeId> geometries;  // InlineGeometry by its file and hints
    NodeId single{};                                     // only this node, with its descendants, is written
    NodeId home{};                                       // the scope that counts as the document

    /// Whether a node is replaced by its content.
    bool isExpanded(const Node& node) const {
        if (isInstance(node.type())) return options.expandPrototypes && !content(node).empty();
        if (node.is(x3d::InlineGeometry::type)) return options.expandGeometries && !content(node).empty();
        return options.expandInlines && isInline(node) && !content(node).empty();
    }
    /// Whether a node stands for the first of its content, rather than for a Group of all.
    static bool isStandIn(const Node& node) { return isInstance(node.type()) || node.is(x3d::InlineGeometry::type); }
    static bool isInline(const Node& node) {
        return node.type().kind == NodeType::Kind::builtin && node.type().name == "Inline";
    }
    /// Whether what becomes a Group keeps the field.
    static bool groupHas(const FieldDef& def) {
        static const NodeType& group = *findBuiltinType("Group");
        const FieldIndex same = group.findExact(def.name);
        return same != kNoField && !def.hidden && !group.fields[same].hidden && haveOneType(group.fields[same], def);
    }
    static const Array<NodeId>& content(const Node& node) {
        static const Array<NodeId> none;
        const FieldIndex body = node.type().body();
        return body == kNoField ? none : *static_cast<const Array<NodeId>*>(node.storage(body));
    }
    /// The node that stands for an instance: the first of its body, or of that one's.
    const Node* standIn(const Node* node) const {
        while (node && isInstance(node->type()) && isExpanded(*node)) node = scene.find(content(*node)[0]);
        return node;
    }
    /// Whether everything around the node is expanded, so that it is the document's own.
    bool isOfDocument(const Node& node) const {
        for (NodeId scope = node.scope(); scope && scope != home;) {
            const Node* around = scene.find(scope);
            if (!around || !isExpanded(*around)) return false;
            scope = around->scope();
        }
        return true;
    }

    std::string_view nameOf(NodeId id) const {
        const auto found = given.find(id.value);
        return found == given.end() ? scene.name(id) : std::string_view(found->second);
    }

    Array<NodeId> childrenOf(const Node& node, FieldIndex field) const {
        if (node.type().fields[field].type == FieldType::MFNode)
            return *static_cast<const Array<NodeId>*>(node.storage(field));
        const NodeId only = *static_cast<const NodeId*>(node.storage(field));
        return only ? Array<NodeId>{only} : Array<NodeId>();
    }

    /// Field values that a document states, not those that a PROTO provides by itself.
    bool isOwnField(const FieldDef& def) const {
        return !def.hidden && def.access != Access::inputOnly && def.access != Access::outputOnly;
    }

    /// The first InlineGeometry that loads the same file in the same way; any other node itself.
    const Node& shared(const Node& node) {
        using N = x3d::InlineGeometry;
        if (!node.is(N::type)) return node;
        const auto key = fmt::format("{} {} {} {}", node.scope().value, node.get(N::solid), node.get(N::smooth),
                                     node.get(N::loadedUrl).str());
        return scene.node(geometries.try_emplace(key, node.id()).first->second);
    }

    void start();
    void walk(DocumentHandler* handler);
    void walkFrom(NodeId root, std::string_view field, DocumentHandler* handler,
                  std::unordered_set<std::uint32_t>& begun);
    void fieldStart(const Node& node, FieldIndex field, DocumentHandler& handler) const;
    bool canBeSaid(const Node& node, FieldIndex field, const Value& value) const;
    void moveUrls(const Node& node, FieldIndex field, Value& value) const;
    void findRoutes();
    void nameNodes();
    void nameApart();
    void findEnds(NodeId node, FieldIndex field, bool from, std::vector<std::pair<NodeId, FieldIndex>>& ends) const;
    void writeHead(DocumentHandler& handler, Encoding encoding) const;
    void writeDeclarations(DocumentHandler& handler);
    void writeRoutes(DocumentHandler& handler);
    const Array<String>& info(std::string_view name) const;
};

SceneExporter::SceneExporter(const Scene& scene, Diagnostics& diagnostics, ExportOptions options)
    : state_(std::make_unique<State>(scene, diagnostics, options)) {}
SceneExporter::~SceneExporter() = default;

const Array<String>& SceneExporter::State::info(std::string_view name) const {
    static const Array<String> none;
    const Node& root = scene.node(scene.root());
    const FieldIndex field = hiddenField(root.type(), name);
    return field == kNoField ? none : *static_cast<const Array<String>*>(root.storage(field));
}

/// Whether a Script's (or shader's) field was declared by its author.
static bool isDeclared(const NodeType& type, const FieldDef& def) {
    if (type.kind != NodeType::Kind::script) return false;
    const NodeType* base = findBuiltinType(type.name);
    return !base || base->findExact(def.name) == kNoField;
}

/// Whether a document can hold the value; if not, this is reported, and the field is left out.
bool SceneExporter::State::canBeSaid(const Node& node, FieldIndex field, const Value& value) const {
    const std::optional<double> number = detail::firstNotFinite(value);
    if (!number) return true;
    const std::string_view name = nameOf(node.id());
    diagnostics.error({}, fmt::format("{}.{} holds {}, which no document can say: the field is left out",
                                      name.empty() ? "a " + node.type().name : std::string(name),
                                      node.type().fields[field].name, *number));
    return false;
}

/// Urls of an Inline's document start from its own folder; once its nodes stand in this one, from its place.
void SceneExporter::State::moveUrls(const Node& node, FieldIndex field, Value& value) const {
    if (!value.holds<Array<String>>() || !node.type().isA("X3DUrlObject")) return;
    for (const Route& giver : scene.routesTo(node.id()))
        if (giver.isConnection && giver.toField == field) return;  // it starts from where the PROTO has its instance
    std::vector<String> moved;
    for (const String& url : value.as<Array<String>>()) {
        std::string text = url.str();
        for (NodeId scope = node.scope(); scope && scope != home && isRelative(text);) {
            const Node& around = scene.node(scope);
            if (const FieldIndex loaded = hiddenField(around.type(), "loadedUrl"); loaded != kNoField)
                text = joinUrls(around.get(Field<String>{loaded}).str(), text) +
                       text.substr(std::min(text.find('#'), text.size()));
            scope = around.scope();
        }
        if (options.packageUrl && text.starts_with("package:")) text = options.packageUrl(text);
        moved.emplace_back(text);
    }
    value = Value(Array<String>(std::span<const String>(moved)));
}

/// The value of one field, or the declaration that its nodes follow.
void SceneExporter::State::fieldStart(const Node& node, FieldIndex field, DocumentHandler& handler) const {
    const NodeType& type = node.type();
    const FieldDef& def = type.fields[field];
    const bool holdsNodes = sf(def.type) == FieldType::SFNode;
    if (!def.hidden && isDeclared(type, def)) {
        std::optional<Value> value;
        if (isOwnField(def) && (!holdsNodes || node.isDefault(field))) value = node.value(field);
        if (value && !canBeSaid(node, field, *value)) value.reset();
        handler.declareField({def.access, def.type, def.name, {}, def.custom}, std::move(value), {});
        return;
    }
    if (!isOwnField(def)) return;
    if (options.listsVisible && node.is(x3d::CADLayer::type) && field == x3d::CADLayer::visible.index) {
        if (node.get(x3d::CADLayer::visible)) return;
        handler.setField(def.name, Value(Array<bool>::ofSize(node.get(x3d::CADLayer::children).size())), {});
    } else if (!holdsNodes) {
        if (node.isDefault(field)) return;
        if (Value value = node.value(field); canBeSaid(node, field, value)) {
            if (def.name == "url" && node.scope() != home) moveUrls(node, field, value);
            handler.setField(def.name, std::move(value), {});
        }
    } else if (node.isDefault(field) && isInstance(type) &&
               declarations.nodeDefaults.contains(fmt::format("{}.{}", declaredName(type), def.name))) {
        handler.setField(def.name, node.value(field), {});  // overrides the default nodes by none
    }
}

/// Visits every node of the document, depth first, in the order of fields; twice the same way: first to count, then,
/// with a handler, to send.
void SceneExporter::State::start() {
    seen.clear();
    given.clear();
    order.clear();
    routes.clear();
    expanded.clear();
    geometries.clear();
    declarations = {};
    declared = declaredTypes(scene);
}

void SceneExporter::State::walk(DocumentHandler* handler) {
    std::unordered_set<std::uint32_t> begun;
    hidden.clear();
    if (single) return walkFrom(single, {}, handler, begun);
    const FieldIndex rootChildren = scene.node(scene.root()).type().findExact("children");
    for (const NodeId root : childrenOf(scene.node(scene.root()), rootChildren)) walkFrom(root, {}, handler, begun);
    if (hidden.empty()) return;
    // The nodes of a prototype's body after the first: they act and are not shown.
    if (handler) handler->beginNode("Switch", {}, {}, {});
    for (std::size_t i = 0; i < hidden.size(); ++i)  // it grows
        walkFrom(hidden[i], "children", handler, begun);
    if (handler) handler->endNode({});
}

void SceneExporter::State::walkFrom(NodeId rootNode, std::string_view rootField, DocumentHandler* handler,
                                    std::unordered_set<std::uint32_t>& begun) {
    std::vector<Position> path;
    const auto begin = [&](NodeId id, std::string_view field, NodeId parent) {
        const Node* node = scene.find(id);
        if (!node) return;
        if (!isOfDocument(*node)) {
            // An instance's own default nodes come with its declaration; anything else has no name out here.
            if (!handler && node->scope() != parent)
                diagnostics.warning({}, fmt::format("{} {} lies inside a PROTO or Inline and is not saved here",
                                                    node->type().name, scene.name(id)));
            return;
        }
        while (isStandIn(*node) && isExpanded(*node)) {
            const Array<NodeId>& nodes = content(shared(*node));
            if (begun.insert(node->id().value).second) {
                if (!handler) expanded.push_back(node->id());
                for (std::size_t i = 1; i < nodes.size(); ++i) hidden.push_back(nodes[i]);
            }
            node = scene.find(nodes[0]);
            if (!node) return;
        }
        const NodeId stands = node->id();
        const bool first = begun.insert(stands.value).second;
        if (!handler) {
            ++seen[stands.value];
            if (first) order.push_back(stands);
        }
        if (!first) {
            if (handler) handler->useNode(nameOf(stands), field, {});
            return;
        }
        const std::string& name = node->type().name;
        if (!handler && name.find('#') != std::string::npos &&
            std::ranges::find(declared, &node->type()) == declared.end())
            diagnostics.error({},
                              fmt::format("{} is of PROTO {}, which is not the document's own; saved under its name",
                                          scene.name(stands), name));
        const bool isGroup = isExpanded(*node);
        if (handler)
            handler->beginNode(isGroup ? "Group" : std::string_view(name).substr(0, name.find('#')), nameOf(stands),
                               field, {});
        path.push_back({node});
    };
    begin(rootNode, rootField, {});
    while (!path.empty()) {
        Position& at = path.back();
        const NodeType& type = at.node->type();
        if (at.field == type.fields.size()) {
            if (handler) handler->endNode({});
            path.pop_back();
            continue;
        }
        const auto field = static_cast<FieldIndex>(at.field);
        const FieldDef& def = type.fields[field];
        // Writes the content of an Inline, and the fields that a Group has as well.
        const bool isContent = isExpanded(*at.node) && field == type.body();
        if (isExpanded(*at.node) && !isContent && !groupHas(def)) {
            ++at.field;
            continue;
        }
        if (at.child == 0 && handler) fieldStart(*at.node, field, *handler);
        if (!isContent && (sf(def.type) != FieldType::SFNode || !isOwnField(def))) {
            ++at.field;
            continue;
        }
        const Array<NodeId> children = isContent ? content(*at.node) : childrenOf(*at.node, field);
        if (at.child < children.size()) {
            const NodeId parent = at.node->id();
            begin(children[at.child++], isContent ? "children" : def.name, parent);  // may move `at`
        } else {
            ++at.field;
            at.child = 0;
        }
    }
}

/// Names of expanded instances and Inlines may be those of others: of a name the first node keeps it.
void SceneExporter::State::nameApart() {
    std::unordered_set<std::string> taken;
    const auto name = [&](NodeId id, std::string_view wanted) {
        std::string result(wanted);
        for (int copy = 2; !taken.insert(result).second; ++copy) result = fmt::format("{}_{}", wanted, copy);
        given.insert_or_assign(id.value, result);
    };
    std::unordered_map<std::uint32_t, NodeId> instances;  // by the node that stands for them: the outermost
    scene.forEachNode([&](const Node& node) {
        if (!isInstance(node.type()) || !isExpanded(node) || scene.name(node.id()).empty()) return;
        if (const Node* stands = standIn(&node); stands && isOfDocument(node)) {
            const auto [found, isNew] = instances.try_emplace(stands->id().value, node.id());
            if (!isNew && !node.scope()) found->second = node.id();
        }
    });
    for (const bool own : {true, false})  // those outside prototypes first
        for (const NodeId id : order) {
            const auto instance = instances.find(id.value);
            const NodeId named = instance == instances.end() ? id : instance->second;
            if (!scene.name(named).empty() && own == !scene.node(named).scope()) name(id, scene.name(named));
        }
}

/// The nodes behind an instance's field: those that get its events, or (`from`) those whose events it sends.
void SceneExporter::State::findEnds(NodeId id, FieldIndex field, bool from,
                                    std::vector<std::pair<NodeId, FieldIndex>>& ends) const {
    std::vector<std::pair<NodeId, FieldIndex>> waiting{{id, field}};
    while (!waiting.empty()) {
        const auto [node, at] = waiting.back();
        waiting.pop_back();
        const Node* known = scene.find(node);
        if (!known) continue;
        if (!isInstance(known->type()) || !isExpanded(*known)) {
            // initializeOnly fields behind an IS take no events.
            const FieldDef& def = known->type().fields[at];
            const bool passes =
                (node == id || (from ? def.sends() : def.writable())) && (!isExpanded(*known) || groupHas(def));
            const bool isLoad = known->is(x3d::InlineGeometry::type) && def.name == "load";
            if (!passes && node == id && isExpanded(*known) && !isLoad)  // what is in the document is there already
                diagnostics.warning(
                    {}, fmt::format("a route of {}'s {} is left out: a Group has none", nameOf(node), def.name));
            if (seen.contains(node.value) && passes) ends.emplace_back(node, at);
            continue;
        }
        const auto take = [&](NodeId inside, FieldIndex its) {
            const Node* body = scene.find(inside);
            if (body && body->scope() == node && std::ranges::find(waiting, std::pair(inside, its)) == waiting.end())
                waiting.emplace_back(inside, its);
        };
        for (const Route& route : scene.routesFrom(node))
            if (route.isConnection && route.fromField == at) take(route.toNode, route.toField);
        for (const Route& route : scene.routesTo(node))
            if (route.isConnection && route.toField == at) take(route.fromNode, route.fromField);
    }
    std::ranges::sort(ends, [](const auto& a, const auto& b) {
        return a.first.value != b.first.value ? a.first.value < b.first.value : a.second < b.second;
    });
    ends.erase(std::ranges::unique(ends).begin(), ends.end());
}

/// In document order, from each node outwards; then those of instances that are expanded.
void SceneExporter::State::findRoutes() {
    const auto add = [&](const Route& route, NodeId from, FieldIndex fromField) {
        std::vector<std::pair<NodeId, FieldIndex>> ends;
        findEnds(route.toNode, route.toField, false, ends);
        for (const auto& [to, toField] : ends)
            if (const Route one{from, fromField, to, toField, false};
                expanded.empty() || std::ranges::find(routes, one) == routes.end())
                routes.push_back(one);
    };
    for (const NodeId id : order)
        for (const Route& route : scene.routesFrom(id))
            if (!route.isConnection) add(route, id, route.fromField);
    for (const NodeId id : expanded)
        for (const Route& route : scene.routesFrom(id)) {
            if (route.isConnection) continue;
            std::vector<std::pair<NodeId, FieldIndex>> sources;
            findEnds(id, route.fromField, true, sources);
            for (const auto& [from, field] : sources) add(route, from, field);
        }
}

void SceneExporter::State::nameNodes() {
    if (options.expandPrototypes || options.expandInlines || options.expandGeometries) nameApart();
    std::unordered_set<std::uint32_t> routed;
    for (const Route& route : routes) {
        routed.insert(route.fromNode.value);
        routed.insert(route.toNode.value);
    }
    std::unordered_set<std::string> taken;
    for (const auto& [id, name] : given) taken.insert(name);
    std::size_t count = 0;
    for (const NodeId id : order) {
        if (!nameOf(id).empty()) continue;
        if (seen[id.value] < 2 && !routed.contains(id.value)) continue;
        std::string name;
        do {
            name = fmt::format("_{}", ++count);
        } while (scene.findName(name) || taken.contains(name));
        given.emplace(id.value, std::move(name));
    }
}

void SceneExporter::State::writeHead(DocumentHandler& handler, Encoding encoding) const {
    const DocumentHead head = headOf(scene);
    DocumentHeader header;
    header.encoding = encoding;
    header.profile = head.profile;
    handler.beginDocument(header);
    for (const auto& one : head.components) handler.component(one.name, one.level, {});
    for (const auto& one : head.units) handler.unit(one.category, one.name, one.conversionFactor, {});
    for (const auto& one : head.meta) handler.meta(one.name, one.content, {});
}

void SceneExporter::State::writeDeclarations(DocumentHandler& handler) {
    const auto isLeft = [&](NodeId id) { return isInstance(scene.node(id).type()); };
    if (options.expandPrototypes && std::ranges::none_of(order, isLeft)) return;
    const std::string text = declarationsOf(scene);
    if (text.empty()) return;
    CommandList read;
    Diagnostics again(diagnostics.file());  // values were checked, and reported, when they were loaded
    const FieldTypesInScope known(fieldTypesOf(scene));
    readDocument(text, read, again, {.dialect = dialectOf(scene)});
    if (again.errors() > 0) diagnostics.append(again);
    read.replay(declarations);
    Contents contents(&handler);
    read.replay(contents);
}

void SceneExporter::State::writeRoutes(DocumentHandler& handler) {
    const Array<String>&imports = info("imports"), &exports = info("exports"), &importRoutes = info("importRoutes");
    std::unordered_set<std::string> inPlace;  // imported names whose nodes stand in the document now
    for (std::size_t i = 0; i + 2 < imports.size(); i += 3) {
        const Node* from = scene.find(scene.findName(imports[i]));
        if (from && isExpanded(*from))
            inPlace.insert(imports[i + 2].str());
        else
            handler.importNode(imports[i], imports[i + 1], imports[i + 2], {});
    }
    for (std::size_t i = 0; i + 1 < exports.size(); i += 2) handler.exportNode(exports[i], exports[i + 1], {});
    for (const Route& route : routes)
        handler.route(nameOf(route.fromNode), scene.node(route.fromNode).type().fields[route.fromField].name,
                      nameOf(route.toNode), scene.node(route.toNode).type().fields[route.toField].name, {});
    for (std::size_t i = 0; i + 3 < importRoutes.size(); i += 4)
        if (!inPlace.contains(importRoutes[i].str()) && !inPlace.contains(importRoutes[i + 2].str()))
            handler.route(importRoutes[i], importRoutes[i + 1], importRoutes[i + 2], importRoutes[i + 3], {});
}

void SceneExporter::write(DocumentHandler& handler, Encoding encoding) {
    State& s = *state_;
    s.start();
    s.walk(nullptr);
    s.findRoutes();
    s.nameNodes();
    s.writeHead(handler, encoding);
    s.writeDeclarations(handler);
    s.walk(&handler);
    s.writeRoutes(handler);
    handler.endDocument();
}

void SceneExporter::writeNode(DocumentHandler& handler, NodeId node, Encoding encoding) {
    State& s = *state_;
    s.start();
    s.single = node;
    if (const Node* known = s.scene.find(node)) s.home = known->scope();
    s.walk(nullptr);
    s.nameNodes();
    DocumentHeader header;
    header.encoding = encoding;
    handler.beginDocument(header);
    s.walk(&handler);
    handler.endDocument();
    s.single = s.home = {};
}

}  // namespace rtsg
