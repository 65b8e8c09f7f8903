// ROUTE, IMPORT and EXPORT: which names they mean, and whether the standard lets them be connected.
#include <algorithm>

#include <fmt/format.h>

#include "builder_state.h"
#include "commands/suggestion.h"
#include "media/font_reports.h"

namespace rtsg {

namespace {

/// A flat list of tuples, as RtsgScene and Inline keep them.
const Array<String>* tuples(const Scene& scene, NodeId scope, std::string_view name) {
    const Node* node = scene.find(scope ? scope : scene.root());
    if (!node) return nullptr;
    const FieldIndex field = hiddenField(node->type(), name);
    return field == kNoField ? nullptr : static_cast<const Array<String>*>(node->storage(field));
}

/// Null if `id.name` may send (or take) events, otherwise the fault.
std::string checkEnd(const Node& node, std::string_view nodeName, std::string_view fieldName, bool sends,
                     FieldIndex& field) {
    field = node.type().find(fieldName);
    if (field == kNoField)
        return detail::noField(node.type(), fmt::format("{} {}", node.type().name, nodeName), fieldName);
    const FieldDef& def = node.type().fields[field];
    if (sends ? def.sends() : def.writable()) return {};
    return fmt::format("{}.{} is {} and {} events", nodeName, def.name, accessName(def.access),
                       sends ? "sends no" : "takes no");
}

std::string addCheckedRoute(Scene& scene, NodeId from, std::string_view fromName, std::string_view fromField, NodeId to,
                            std::string_view toName, std::string_view toField) {
    FieldIndex a = kNoField, b = kNoField;
    if (std::string wrong = checkEnd(scene.node(from), fromName, fromField, true, a); !wrong.empty()) return wrong;
    if (std::string wrong = checkEnd(scene.node(to), toName, toField, false, b); !wrong.empty()) return wrong;
    const FieldDef &out = scene.node(from).type().fields[a], &in = scene.node(to).type().fields[b];
    if (!haveOneType(out, in))
        return fmt::format("the fields differ in type: {} and {}", out.typeName(), in.typeName());
    if (auto added = scene.addRoute(from, a, to, b); !added) return added.error().text;
    return {};
}

}  // namespace

void SceneBuilder::route(std::string_view fromNode, std::string_view fromField, std::string_view toNode,
                         std::string_view toField, SourceLocation where) {
    State& s = *state_;
    s.noteWork(where);
    if (s.skipProtoDepth || s.skipDepth) return;
    if (s.isRecording()) {
        if (s.recordingOpen.back() != 'i') s.recorder().route(fromNode, fromField, toNode, toField, where);
        return;
    }
    NameScope& scope = s.scope();
    if (scope.declarationsOnly) return;
    // A name means the node that has it here; one that is given later is looked up at the end of the document.
    const auto known = [&](std::string_view name) {
        const auto found = scope.names.find(name);
        return found == scope.names.end() || found->second == kSelf ? NodeId{} : found->second;
    };
    scope.routes.push_back({known(fromNode), known(toNode), std::string(fromNode), std::string(fromField),
                            std::string(toNode), std::string(toField), where});
}

void SceneBuilder::importNode(std::string_view inlineDef, std::string_view exportedName, std::string_view localName,
                              SourceLocation where) {
    State& s = *state_;
    s.noteWork(where);
    if (s.skipProtoDepth || s.skipDepth) return;
    if (s.isRecording()) {
        if (s.recordingOpen.back() != 'i') s.recorder().importNode(inlineDef, exportedName, localName, where);
        return;
    }
    NameScope& scope = s.scope();
    if (scope.declarationsOnly) return;
    const std::string_view local = localName.empty() ? exportedName : localName;
    if (!scope.importedNames.emplace(local).second) {
        s.error(where, fmt::format("IMPORT AS '{}': another IMPORT has that name", local));
        return;
    }
    scope.imports.push_back({std::string(inlineDef), std::string(exportedName), std::string(local), where});
}

void SceneBuilder::exportNode(std::string_view localName, std::string_view exportedName, SourceLocation where) {
    State& s = *state_;
    s.noteWork(where);
    if (s.skipProtoDepth || s.skipDepth) return;
    if (s.isRecording()) {
        if (s.recordingOpen.back() != 'i') s.recorder().exportNode(localName, exportedName, where);
        return;
    }
    if (s.scope().declarationsOnly) return;
    s.scope().exports.push_back(
        {std::string(localName), std::string(exportedName.empty() ? localName : exportedName), where});
}

void SceneBuilder::State::finishScope(NameScope& in) {
    resolveRoutes(in);
    storeImports(in);
    if (options.loadInlines)
        for (const auto& [id, where] : in.fontLibraries) readFont(scene, id, *options.resources, diagnostics, where);
    if (options.loadInlines)
        for (const auto& [id, where] : in.inlines) loadInline(id, where);
    if (in.imports.empty()) return;
    connectImports(scene, in.owner, &diagnostics);
    for (const ImportStatement& one : in.imports) {
        const Node* from = scene.find(scene.findName(one.inlineDef, in.owner));
        if (!from || hiddenField(from->type(), "body") == kNoField || from->isDefault(from->type().body())) continue;
        if (!resolveLocalName(scene, in.owner, one.local))
            error(one.where,
                  fmt::format("IMPORT {}.{}: the inlined document exports no such name", one.inlineDef, one.exported));
    }
}

void SceneBuilder::State::resolveRoutes(NameScope& in) {
    std::vector<PendingRoute> imported;
    for (PendingRoute& route : in.routes) {
        const auto resolve = [&](NodeId known, const std::string& name) {
            if (known) return known;
            const auto found = in.names.find(name);
            return found == in.names.end() || found->second == kSelf ? NodeId{} : found->second;
        };
        const auto isImported = [&](NodeId known, const std::string& name) {
            return !known && in.importedNames.contains(name);
        };
        const NodeId from = resolve(route.from, route.fromNode), to = resolve(route.to, route.toNode);
        if (isImported(from, route.fromNode) || isImported(to, route.toNode)) {
            imported.push_back(std::move(route));
            continue;
        }
        std::string wrong;
        if (from == kOfUnknownType || to == kOfUnknownType) {
            warning(route.where, fmt::format("ROUTE {}.{} TO {}.{} does nothing: {} is of an unknown type",
                                             route.fromNode, route.fromField, route.toNode, route.toField,
                                             from == kOfUnknownType ? route.fromNode : route.toNode));
            continue;
        }
        if (!from || !to)
            wrong = fmt::format("no node is named '{}'", from ? route.toNode : route.fromNode);
        else
            wrong = addCheckedRoute(scene, from, route.fromNode, route.fromField, to, route.toNode, route.toField);
        if (!wrong.empty())
            error(route.where, fmt::format("ROUTE {}.{} TO {}.{}: {}", route.fromNode, route.fromField, route.toNode,
                                           route.toField, wrong));
    }
    in.routes = std::move(imported);
}

void SceneBuilder::State::storeImports(NameScope& in) {
    if (in.imports.empty() && in.exports.empty() && in.routes.empty()) return;
    if (options.detached && &in == scopes.front().get()) {
        constexpr std::string_view kWhy = "belongs to a document, and is left out of a piece that is put into another";
        for (const ImportStatement& one : in.imports) error(one.where, fmt::format("IMPORT {}", kWhy));
        for (const ExportStatement& one : in.exports) error(one.where, fmt::format("EXPORT {}", kWhy));
        for (const PendingRoute& one : in.routes) error(one.where, fmt::format("ROUTE to an imported name {}", kWhy));
        return;
    }
    const NodeId holder = in.owner ? in.owner : scene.root();
    const NodeType& type = scene.node(holder).type();
    if (type.name == "InlineGeometry" && type.kind == NodeType::Kind::builtin) return;  // its names are nobody's
    if (hiddenField(type, "imports") == kNoField) {
        for (const ImportStatement& one : in.imports) error(one.where, "IMPORT cannot stand in a PROTO body");
        for (const ExportStatement& one : in.exports) error(one.where, "EXPORT cannot stand in a PROTO body");
        for (const PendingRoute& one : in.routes) error(one.where, "ROUTE to an imported name in a PROTO body");
        return;
    }
    const auto append = [&](std::string_view name, const std::vector<std::string>& added) {
        if (added.empty()) return;
        Array<String> list = *tuples(scene, holder, name);
        for (const std::string& one : added) list.push_back(String(one));
        setHidden(scene, holder, hiddenField(type, name), Value(std::move(list)));
    };
    std::vector<std::string> imports, exports, routes;
    for (const ImportStatement& one : in.imports) {
        const auto found = in.names.find(one.inlineDef);
        const Node* node = found == in.names.end() ? nullptr : scene.find(found->second);
        if (!node || hiddenField(node->type(), "exports") == kNoField)
            error(one.where,
                  fmt::format("IMPORT {}.{}: no Inline is named '{}'", one.inlineDef, one.exported, one.inlineDef));
        if (in.names.contains(one.local))
            error(one.where, fmt::format("IMPORT AS '{}': a node has that name already", one.local));
        imports.insert(imports.end(), {one.inlineDef, one.exported, one.local});
    }
    for (const ExportStatement& one : in.exports) {
        const bool known = in.names.contains(one.local) || in.importedNames.contains(one.local);
        if (!known) error(one.where, fmt::format("EXPORT '{}': no node has that name", one.local));
        exports.insert(exports.end(), {one.local, one.exported});
    }
    for (const PendingRoute& one : in.routes)
        routes.insert(routes.end(), {one.fromNode, one.fromField, one.toNode, one.toField});
    append("imports", imports);
    append("exports", exports);
    append("importRoutes", routes);
}

NodeId resolveLocalName(const Scene& scene, NodeId scope, std::string_view name, int depth) {
    if (const NodeId own = scene.findName(name, scope)) return own;
    constexpr int kMaximumReexports = 32;
    const Array<String>* imports = depth < kMaximumReexports ? tuples(scene, scope, "imports") : nullptr;
    if (!imports) return {};
    for (std::size_t i = 0; i + 2 < imports->size(); i += 3) {
        if ((*imports)[i + 2].view() != name) continue;
        const NodeId from = scene.findName((*imports)[i], scope);
        const Array<String>* exports = from ? tuples(scene, from, "exports") : nullptr;
        if (!exports) return {};
        for (std::size_t k = 0; k + 1 < exports->size(); k += 2)
            if ((*exports)[k + 1] == (*imports)[i + 1]) return resolveLocalName(scene, from, (*exports)[k], depth + 1);
        return {};
    }
    return {};
}

std::size_t connectImports(Scene& scene, NodeId scope, Diagnostics* diagnostics) {
    const Array<String>* stored = tuples(scene, scope, "importRoutes");
    if (!stored) return 0;
    const Array<String> routes = *stored;
    std::size_t missing = 0;
    for (std::size_t i = 0; i + 3 < routes.size(); i += 4) {
        const NodeId from = resolveLocalName(scene, scope, routes[i]);
        const NodeId to = resolveLocalName(scene, scope, routes[i + 2]);
        if (!from || !to) {
            ++missing;  // its Inline is not there (yet): reported where it was loaded
            continue;
        }
        const std::string wrong =
            addCheckedRoute(scene, from, routes[i], routes[i + 1], to, routes[i + 2], routes[i + 3]);
        if (!wrong.empty() && diagnostics)
            diagnostics->error({}, fmt::format("ROUTE {}.{} TO {}.{}: {}", routes[i].view(), routes[i + 1].view(),
                                               routes[i + 2].view(), routes[i + 3].view(), wrong));
    }
    return missing;
}

}  // namespace rtsg
