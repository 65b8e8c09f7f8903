// Walks a scene and says it again as the commands of a document: declarations first, shared nodes once.
#include <rtsg/core/scene_exporter.h>

#include <algorithm>
#include <charconv>
#include <unordered_map>
#include <unordered_set>

#include <fmt/format.h>

#include <rtsg/core/command_list.h>
#include <rtsg/core/filter.h>
#include <rtsg/core/loader.h>

#include "builder_state.h"

namespace rtsg {

namespace {

bool isInstance(const NodeType& type) {
    return type.kind == NodeType::Kind::proto || type.kind == NodeType::Kind::externProto;
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

/// Passes on what stands in a document, not the document itself.
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
    std::unordered_map<std::uint32_t, std::uint32_t> seen;  // node -> times met
    std::unordered_map<std::uint32_t, std::string> given;   // names of ours
    std::vector<NodeId> order;                              // document order
    DeclarationScan declarations;

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

    /// Field values that a document states: not what a PROTO provides by itself.
    bool isOwnField(const FieldDef& def) const {
        return !def.hidden && def.access != Access::inputOnly && def.access != Access::outputOnly;
    }

    void walk(DocumentHandler* handler);
    void enter(const Node& node, std::string_view field, DocumentHandler* handler);
    void fieldStart(const Node& node, FieldIndex field, DocumentHandler& handler) const;
    void nameNodes();
    void writeHead(DocumentHandler& handler, Encoding encoding) const;
    void writeDeclarations(DocumentHandler& handler);
    void writeRoutes(DocumentHandler& handler);
    const Array<String>& info(std::string_view name) const;
};

SceneExporter::SceneExporter(const Scene& scene, Diagnostics& diagnostics)
    : state_(std::make_unique<State>(scene, diagnostics)) {}
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

/// The value of one field, or the declaration that its nodes follow.
void SceneExporter::State::fieldStart(const Node& node, FieldIndex field, DocumentHandler& handler) const {
    const NodeType& type = node.type();
    const FieldDef& def = type.fields[field];
    const bool holdsNodes = sf(def.type) == FieldType::SFNode;
    if (!def.hidden && isDeclared(type, def)) {
        std::optional<Value> value;
        if (isOwnField(def) && (!holdsNodes || node.isDefault(field))) value = node.value(field);
        handler.declareField({def.access, def.type, def.name}, std::move(value), {});
        return;
    }
    if (!isOwnField(def)) return;
    if (!holdsNodes) {
        if (!node.isDefault(field)) handler.setField(def.name, node.value(field), {});
    } else if (node.isDefault(field) && isInstance(type) &&
               declarations.nodeDefaults.contains(fmt::format("{}.{}", type.name, def.name))) {
        handler.setField(def.name, node.value(field), {});  // overrides the default nodes by none
    }
}

/// Visits every node of the document, depth first, in the order of fields; twice the same way: first to count, then,
/// with a handler, to send.
void SceneExporter::State::walk(DocumentHandler* handler) {
    std::unordered_set<std::uint32_t> begun;
    std::vector<Position> path;
    const FieldIndex rootChildren = scene.node(scene.root()).type().findExact("children");
    const auto begin = [&](NodeId id, std::string_view field, NodeId parent) {
        const Node* node = scene.find(id);
        if (!node) return;
        const bool ofDocument = !node->scope();
        if (!ofDocument) {
            // An instance's own default nodes come with its declaration; anything else has no name out here.
            if (!handler && node->scope() != parent)
                diagnostics.warning({}, fmt::format("{} {} lies inside a PROTO or Inline and is not saved here",
                                                    node->type().name, scene.name(id)));
            return;
        }
        const bool first = begun.insert(id.value).second;
        if (!handler) {
            ++seen[id.value];
            if (first) order.push_back(id);
        }
        if (!first) {
            if (handler) handler->useNode(nameOf(id), field, {});
            return;
        }
        const std::string& name = node->type().name;
        if (!handler && name.find('#') != std::string::npos)
            diagnostics.error({},
                              fmt::format("{} is of PROTO {}, which is not the document's own; saved under its name",
                                          scene.name(id), name));
        if (handler) handler->beginNode(std::string_view(name).substr(0, name.find('#')), nameOf(id), field, {});
        path.push_back({node});
    };
    for (const NodeId rootNode : childrenOf(scene.node(scene.root()), rootChildren)) {
        begin(rootNode, {}, {});
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
            if (at.child == 0 && handler) fieldStart(*at.node, field, *handler);
            if (sf(def.type) != FieldType::SFNode || !isOwnField(def)) {
                ++at.field;
                continue;
            }
            const Array<NodeId> children = childrenOf(*at.node, field);
            if (at.child < children.size()) {
                const NodeId parent = at.node->id();
                begin(children[at.child++], def.name, parent);  // may move `at`
            } else {
                ++at.field;
                at.child = 0;
            }
        }
    }
}

void SceneExporter::State::nameNodes() {
    std::size_t count = 0;
    for (const NodeId id : order) {
        if (!scene.name(id).empty()) continue;
        bool needed = seen[id.value] > 1;
        const auto counts = [&](const Route& route, NodeId other) {
            return !route.isConnection && seen.contains(other.value);
        };
        if (!needed)
            for (const Route& route : scene.routesFrom(id)) needed |= counts(route, route.toNode);
        if (!needed)
            for (const Route& route : scene.routesTo(id)) needed |= counts(route, route.fromNode);
        if (!needed) continue;
        std::string name;
        do {
            name = fmt::format("_{}", ++count);
        } while (scene.findName(name));
        given.emplace(id.value, std::move(name));
    }
}

void SceneExporter::State::writeHead(DocumentHandler& handler, Encoding encoding) const {
    const Node& root = scene.node(scene.root());
    DocumentHeader header;
    header.encoding = encoding;
    if (const FieldIndex profile = hiddenField(root.type(), "profile"); profile != kNoField)
        header.profile = static_cast<const String*>(root.storage(profile))->str();
    handler.beginDocument(header);
    const Array<String>&components = info("components"), &metas = info("meta"), &units = info("units");
    for (std::size_t i = 0; i + 1 < components.size(); i += 2) {
        int level = 1;
        const std::string_view text = components[i + 1];
        std::from_chars(text.data(), text.data() + text.size(), level);
        handler.component(components[i], level);
    }
    for (std::size_t i = 0; i + 2 < units.size(); i += 3) {
        double factor = 1;
        const std::string_view text = units[i + 2];
        std::from_chars(text.data(), text.data() + text.size(), factor);
        handler.unit(units[i], units[i + 1], factor);
    }
    for (std::size_t i = 0; i + 1 < metas.size(); i += 2) handler.meta(metas[i], metas[i + 1]);
}

void SceneExporter::State::writeDeclarations(DocumentHandler& handler) {
    const std::string text = declarationsOf(scene);
    if (text.empty()) return;
    CommandList read;
    Diagnostics again(diagnostics.file());  // what there is to say of values was said when they were loaded
    readDocument(text, read, again);
    if (again.errors() > 0) diagnostics.append(again);
    read.replay(declarations);
    Contents contents(&handler);
    read.replay(contents);
}

void SceneExporter::State::writeRoutes(DocumentHandler& handler) {
    const Array<String>&imports = info("imports"), &exports = info("exports"), &routes = info("importRoutes");
    for (std::size_t i = 0; i + 2 < imports.size(); i += 3)
        handler.importNode(imports[i], imports[i + 1], imports[i + 2], {});
    for (std::size_t i = 0; i + 1 < exports.size(); i += 2) handler.exportNode(exports[i], exports[i + 1], {});
    for (const NodeId id : order)
        for (const Route& route : scene.routesFrom(id)) {
            if (route.isConnection || !seen.contains(route.toNode.value)) continue;
            handler.route(nameOf(id), scene.node(id).type().fields[route.fromField].name, nameOf(route.toNode),
                          scene.node(route.toNode).type().fields[route.toField].name, {});
        }
    for (std::size_t i = 0; i + 3 < routes.size(); i += 4)
        handler.route(routes[i], routes[i + 1], routes[i + 2], routes[i + 3], {});
}

void SceneExporter::write(DocumentHandler& handler, Encoding encoding) {
    State& s = *state_;
    s.seen.clear();
    s.given.clear();
    s.order.clear();
    s.declarations = {};
    s.walk(nullptr);
    s.nameNodes();
    s.writeHead(handler, encoding);
    s.writeDeclarations(handler);
    s.walk(&handler);
    s.writeRoutes(handler);
    handler.endDocument();
}

}  // namespace rtsg
