// Fields by the names of their nodes: finding them, and their values as text.
#include <rtsg/core/field_path.h>

#include <charconv>
#include <sstream>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>

#include "value/nearest_name.h"

namespace rtsg {

namespace {

/// Names in one scope, for suggestions.
std::vector<std::string_view> namesIn(const Scene& scene, NodeId scope) {
    std::vector<std::string_view> names;
    scene.forEachNode([&](const Node& node) {
        if (const std::string_view name = scene.name(node.id()); node.scope() == scope && !name.empty())
            names.push_back(name);
    });
    return names;
}

/// "#12": a node by its number, which is how those without a name are written. None if it is no such text or node.
NodeId byNumber(const Scene& scene, std::string_view path) {
    std::uint32_t number = 0;
    if (!path.starts_with('#')) return {};
    const auto [end, problem] = std::from_chars(path.data() + 1, path.data() + path.size(), number);
    return problem == std::errc() && end == path.data() + path.size() && scene.find(NodeId{number}) ? NodeId{number}
                                                                                                    : NodeId{};
}

Result<Value> nodesFromText(const Scene& scene, FieldType type, std::string_view text) {
    std::string words(text);
    for (char& c : words)
        if (c == '[' || c == ']' || c == ',') c = ' ';
    std::istringstream in(words);
    Array<NodeId> nodes;
    for (std::string word; in >> word;) {
        if (word == "NULL" && type == FieldType::SFNode) {
            nodes.push_back({});
            continue;
        }
        auto node = findNode(scene, word);
        if (!node) return std::unexpected(std::move(node.error()));
        nodes.push_back(*node);
    }
    if (type == FieldType::MFNode) return Value(std::move(nodes));
    if (nodes.size() != 1) return fail(fmt::format("expected NULL or one node's name, not '{}'", text));
    return Value(nodes[0]);
}

struct FieldValue {
    FieldRef at;
    Value value;
};
Result<FieldValue> parsed(const Scene& scene, std::string_view path, std::string_view text) {
    const auto at = findField(scene, path);
    if (!at) return std::unexpected(at.error());
    const FieldDef& def = scene.node(at->node).type().fields[at->field];
    auto value = sf(def.type) == FieldType::SFNode
                     ? nodesFromText(scene, def.type, text)
                     : parseFieldText(def.type, text, TextSyntax::classicVrml, def.custom.get());
    if (!value) {
        Diagnostic& error = value.error();
        error.text = fmt::format("{}: {}", path, error.text);
        return std::unexpected(std::move(error));
    }
    return FieldValue{*at, std::move(*value)};
}

}  // namespace

Result<NodeId> findNode(const Scene& scene, std::string_view path) {
    NodeId at;  // names may hold slashes, too
    for (std::size_t from = 0;;) {
        if (const NodeId whole = scene.findName(path.substr(from), at)) return whole;
        if (const NodeId numbered = from == 0 ? byNumber(scene, path) : NodeId{}) return numbered;
        const std::size_t slash = path.find('/', from);
        const std::string_view name = path.substr(from, slash == path.npos ? path.npos : slash - from);
        const NodeId next = scene.findName(name, at);
        if (!next)
            return fail(DiagnosticCode("no-such-node"),
                        fmt::format("no node is named {}{}", path.substr(0, from + name.size()),
                                    detail::didYouMean(name, namesIn(scene, at))));
        if (slash == path.npos) return next;
        at = next;
        from = slash + 1;
    }
}

Result<FieldRef> findField(const Scene& scene, std::string_view path) {
    const auto dot = path.rfind('.');
    if (dot == path.npos) return fail(fmt::format("{}: expected DEF.field", path));
    const auto node = findNode(scene, path.substr(0, dot));
    if (!node) return fail(node.error().code, fmt::format("{}: {}", path, node.error().text));
    const NodeType& type = scene.node(*node).type();
    const FieldIndex field = type.find(path.substr(dot + 1));
    if (field == kNoField)
        return fail(DiagnosticCode("no-such-field"),
                    fmt::format("{}: {}", path, detail::noField(type, type.name, path.substr(dot + 1))));
    return FieldRef{*node, field};
}

Result<std::string> fieldText(const Scene& scene, std::string_view path) {
    const auto at = findField(scene, path);
    if (!at) return std::unexpected(at.error());
    const Node& node = scene.node(at->node);
    const FieldDef& def = node.type().fields[at->field];
    if (!def.readable()) return fail(DiagnosticCode("access"), fmt::format("{}: {} has no value", path, def.name));
    if (sf(def.type) != FieldType::SFNode) return printFieldText(node.value(at->field));
    const auto named = [&](NodeId id) {
        const std::string_view name = scene.name(id);
        return !id ? std::string("NULL") : name.empty() ? fmt::format("#{}", id.value) : std::string(name);
    };
    if (def.type == FieldType::SFNode) return named(node.get(Field<NodeId>{at->field}));
    std::string text = "[";
    for (const NodeId id : node.get(Field<Array<NodeId>>{at->field})) text += ' ' + named(id);
    return text + " ]";
}

Result<> setFieldText(Scene& scene, std::string_view path, std::string_view text) {
    auto one = parsed(scene, path, text);
    if (!one) return std::unexpected(std::move(one.error()));
    return scene.setField(one->at.node, one->at.field, std::move(one->value));
}

Result<> sendFieldText(Scene& scene, std::string_view path, std::string_view text) {
    auto one = parsed(scene, path, text);
    if (!one) return std::unexpected(std::move(one.error()));
    return scene.sendEvent(one->at.node, one->at.field, std::move(one->value));
}

}  // namespace rtsg
