// PROTO declarations as text: how they live in NodeType::declaration, and how instances are made from there.
#include <rtsg/documents/loader.h>

#include <algorithm>

#include <fmt/format.h>

#include <rtsg/documents/writer.h>

#include "builder_state.h"

namespace rtsg {

std::string declarationText(const ProtoDeclaration& proto) {
    std::string text;
    const CustomNumbersOnly numbers;  // it travels to whoever lacks the types
    Diagnostics ignored;  // what could not be read is not in the commands; a name that cannot be spelled is no name
    const auto writer = makeWriter(Encoding::classicVrml, [&](std::string_view piece) { text += piece; }, ignored);
    writer->beginDocument({});
    writeDeclaration(proto, *writer);
    writer->endDocument();
    // Less the document's own header.
    const std::size_t start = text.find(proto.external ? "\nEXTERNPROTO " : "\nPROTO ");
    return start == std::string::npos ? std::string() : text.substr(start + 1);
}

std::string_view declaredName(const NodeType& type) {
    return std::string_view(type.name).substr(0, type.name.find('#'));
}

std::vector<const NodeType*> declaredTypes(const Scene& scene) {
    std::vector<std::vector<TypeIndex>> all;  // those of one name, the name's first first
    bool areSeveral = false;
    for (std::size_t i = builtinTypes().size(); i < scene.typeCount(); ++i) {
        const TypeIndex index{static_cast<std::uint16_t>(i)};
        const NodeType& type = scene.type(index);
        const bool isProto = type.kind == NodeType::Kind::proto || type.kind == NodeType::Kind::externProto;
        if (!isProto || type.declaration.empty()) continue;  // those of bodies and of other documents come with them
        const auto known = !type.name.contains('#') ? all.end() : std::ranges::find_if(all, [&](const auto& one) {
            return declaredName(scene.type(one.front())) == declaredName(type);
        });
        if (known == all.end())
            all.push_back({index});
        else
            known->push_back(index), areSeveral = true;
    }
    std::vector<bool> used(areSeveral ? scene.typeCount() : 0);
    if (areSeveral) scene.forEachNode([&](const Node& node) { used[node.typeIndex().value] = true; });
    std::vector<const NodeType*> result;
    for (const auto& ofName : all) {
        const auto isUsed = [&](TypeIndex index) { return areSeveral && used[index.value]; };
        const auto found = std::ranges::find_if(ofName, isUsed);
        result.push_back(&scene.type(found == ofName.end() ? ofName.back() : *found));
    }
    return result;
}

std::vector<std::shared_ptr<const CustomType>> fieldTypesOf(const Scene& scene) {
    std::vector<std::shared_ptr<const CustomType>> result;
    for (std::size_t i = builtinTypes().size(); i < scene.typeCount(); ++i)
        for (const FieldDef& field : scene.type(TypeIndex{static_cast<std::uint16_t>(i)}).fields) {
            const auto isIt = [&](const auto& known) { return *known == *field.custom; };
            if (field.custom && std::ranges::none_of(result, isIt)) result.push_back(field.custom);
        }
    return result;
}

std::string declarationsOf(const Scene& scene) {
    std::string text;
    for (const NodeType* type : declaredTypes(scene)) {
        if (text.empty()) text = "#X3D V4.0 utf8\nPROFILE Full\n";
        text += type->declaration;
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
    return builder.instantiate(declaredName(type), declarationsOf(scene), scope);
}

Result<NodeId> SceneBuilder::instantiate(std::string_view proto, std::string_view declarations, NodeId scope) {
    State& s = *state_;
    s.scope().declarationsOnly = true;
    const FieldTypesInScope known(fieldTypesOf(s.scene));
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
