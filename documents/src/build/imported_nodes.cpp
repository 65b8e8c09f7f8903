// Lets programs read and change what a document imports and exports: ISO/IEC 19775-1 V4.0, 4.4.6, and 19775-2.
#include <algorithm>
#include <span>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/world.h>

#include "builder_state.h"

namespace rtsg {

namespace {

constexpr std::size_t kImport = 3, kExport = 2;  // inlineDEF, exportedName, localName; localName, exportedName

/// kNoField: the scope's name stands for no document.
FieldIndex listField(const Scene& scene, NodeId holder, std::string_view name) {
    const Node* node = scene.find(holder);
    return node ? hiddenField(node->type(), name) : kNoField;
}
NodeId holderOf(const Scene& scene, NodeId scope) {
    return scope ? scope : scene.root();
}
Array<String> statements(const Scene& scene, NodeId scope, std::string_view name) {
    const NodeId holder = holderOf(scene, scope);
    const FieldIndex field = listField(scene, holder, name);
    return field == kNoField ? Array<String>() : scene.node(holder).get(Field<Array<String>>{field});
}

/// The statements of which `column` is not `name`, and `added`.
Array<String> replaced(const Array<String>& list, std::size_t width, std::size_t column, std::string_view name,
                       std::span<const std::string_view> added = {}) {
    Array<String> result;
    for (std::size_t i = 0; i + width <= list.size(); i += width)
        if (list[i + column].view() != name)
            for (std::size_t k = 0; k < width; ++k) result.push_back(list[i + k]);
    for (const std::string_view one : added) result.push_back(String(one));
    return result;
}

Result<> store(Scene& scene, NodeId scope, std::string_view name, Array<String> list) {
    const NodeId holder = holderOf(scene, scope);
    const FieldIndex field = listField(scene, holder, name);
    if (field == kNoField) return fail("only a document and an Inline have imports and exports");
    return scene.setField(holder, field, Value(std::move(list)));
}

Result<> removeStatement(Scene& scene, NodeId scope, std::string_view which, std::size_t width, std::size_t column,
                         std::string_view name) {
    const Array<String> before = statements(scene, scope, which);
    Array<String> after = replaced(before, width, column, name);
    if (after.size() == before.size())
        return fail(fmt::format("nothing is {} as {}", which == "imports" ? "imported" : "exported", name));
    return store(scene, scope, which, std::move(after));
}

}  // namespace

std::vector<ImportedNode> importedNodes(const Scene& scene, NodeId scope) {
    const Array<String> list = statements(scene, scope, "imports");
    std::vector<ImportedNode> result;
    for (std::size_t i = 0; i + kImport <= list.size(); i += kImport)
        result.push_back({list[i + 2].str(), scene.findName(list[i], scope), list[i + 1].str(),
                          findImported(scene, list[i + 2], scope)});
    return result;
}

std::vector<ExportedNode> exportedNodes(const Scene& scene, NodeId scope) {
    const Array<String> list = statements(scene, scope, "exports");
    std::vector<ExportedNode> result;
    for (std::size_t i = 0; i + kExport <= list.size(); i += kExport)
        result.push_back({list[i + 1].str(), list[i].str(), resolveLocalName(scene, scope, list[i])});
    return result;
}

NodeId findImported(const Scene& scene, std::string_view localName, NodeId scope) {
    const Array<String> list = statements(scene, scope, "imports");
    for (std::size_t i = 0; i + kImport <= list.size(); i += kImport)
        if (list[i + 2].view() == localName) return resolveLocalName(scene, scope, localName);
    return {};
}

NodeId findExported(const Scene& scene, std::string_view exportedName, NodeId scope) {
    const Array<String> list = statements(scene, scope, "exports");
    for (std::size_t i = 0; i + kExport <= list.size(); i += kExport)
        if (list[i + 1].view() == exportedName) return resolveLocalName(scene, scope, list[i]);
    return {};
}

Result<> updateImportedNode(Scene& scene, NodeId inlineNode, std::string_view exportedName,
                            std::string_view localName) {
    const Node* node = scene.find(inlineNode);
    if (!node) return fail(DiagnosticCode("no-such-node"), fmt::format("no node {}", inlineNode.value));
    if (inlineNode == scene.root() || hiddenField(node->type(), "exports") == kNoField)
        return fail(fmt::format("{} exports nothing: an Inline does", node->type().name));
    const std::string holder(scene.name(inlineNode));
    if (holder.empty()) return fail("an Inline without a name exports nothing");
    if (localName.empty()) localName = exportedName;
    if (localName.empty()) return fail("a node is imported under a name");
    const NodeId scope = node->scope();
    if (scene.findName(localName, scope)) return fail(fmt::format("a node is named {} already", localName));
    const std::string_view added[] = {holder, exportedName, localName};
    return store(scene, scope, "imports", replaced(statements(scene, scope, "imports"), kImport, 2, localName, added));
}

Result<> removeImportedNode(Scene& scene, std::string_view localName, NodeId scope) {
    return removeStatement(scene, scope, "imports", kImport, 2, localName);
}

Result<> updateExportedNode(Scene& scene, std::string_view exportedName, NodeId node, NodeId scope) {
    const Node* known = scene.find(node);
    if (!known) return fail(DiagnosticCode("no-such-node"), fmt::format("no node {}", node.value));
    if (exportedName.empty()) return fail("a node is exported under a name");
    std::string local(known->scope() == scope ? scene.name(node) : std::string_view());
    if (local.empty()) {  // an imported node may be passed on
        const auto imports = importedNodes(scene, scope);
        const auto found = std::ranges::find(imports, node, &ImportedNode::node);
        if (found == imports.end()) return fail("a node that has no name in the document cannot be exported");
        local = found->localName;
    }
    const std::string_view added[] = {local, exportedName};
    return store(scene, scope, "exports",
                 replaced(statements(scene, scope, "exports"), kExport, 1, exportedName, added));
}

Result<> removeExportedNode(Scene& scene, std::string_view exportedName, NodeId scope) {
    return removeStatement(scene, scope, "exports", kExport, 1, exportedName);
}

}  // namespace rtsg
