// PROTO declarations as text: how they live in NodeType::declaration, and how instances are made from there.
#include <rtsg/documents/loader.h>

#include <fmt/format.h>

#include <rtsg/documents/writer.h>

#include "builder_state.h"

namespace rtsg {

std::string declarationText(const ProtoDeclaration& proto) {
    std::string text;
    Diagnostics ignored;  // what could not be read is not in the commands; a name that cannot be spelled is no name
    const auto writer = makeWriter(Encoding::classicVrml, [&](std::string_view piece) { text += piece; }, ignored);
    writer->beginDocument({});
    writeDeclaration(proto, *writer);
    writer->endDocument();
    // Less the document's own header.
    const std::size_t start = text.find(proto.external ? "\nEXTERNPROTO " : "\nPROTO ");
    return start == std::string::npos ? std::string() : text.substr(start + 1);
}

std::string declarationsOf(const Scene& scene) {
    std::string text;
    for (std::size_t i = builtinTypes().size(); i < scene.typeCount(); ++i) {
        const NodeType& type = scene.type(TypeIndex{static_cast<std::uint16_t>(i)});
        const bool isProto = type.kind == NodeType::Kind::proto || type.kind == NodeType::Kind::externProto;
        // Names with # are of bodies and of other documents: they come with those.
        if (!isProto || type.declaration.empty() || type.name.find('#') != std::string::npos) continue;
        if (text.empty()) text = "#X3D V4.0 utf8\nPROFILE Full\n";
        text += type.declaration;
        if (!text.ends_with('\n')) text += '\n';
    }
    return text;
}

Result<NodeId> instantiate(Scene& scene, TypeIndex proto, Diagnostics& diagnostics, NodeId scope,
                           const BuildOptions& options) {
    if (proto.value >= scene.typeCount()) return fail("no such node type");
    const NodeType& type = scene.type(proto);
    if (type.kind != NodeType::Kind::proto && type.kind != NodeType::Kind::externProto)
        return fail(fmt::format("{} is no PROTO", type.name));
    SceneBuilder builder(scene, diagnostics, options);
    return builder.instantiate(type.name, declarationsOf(scene), scope);
}

Result<NodeId> SceneBuilder::instantiate(std::string_view proto, std::string_view declarations, NodeId scope) {
    State& s = *state_;
    s.scope().declarationsOnly = true;
    readDocument(declarations, *this, s.diagnostics, {.dialect = s.dialect});
    finish();
    if (!s.scope().environment->findHere(proto)) return fail(fmt::format("the declaration of {} is not known", proto));
    s.scope().declarationsOnly = false;
    s.scope().owner = scope;
    beginNode(proto, {}, {}, {});
    endNode({});
    if (s.open[0].children.empty()) return fail(fmt::format("{} could not be instanced", proto));
    return s.open[0].children.front().nodes.front();
}

}  // namespace rtsg
