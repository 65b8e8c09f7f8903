// Makes instances of prototypes by reading their declarations once more, with one instance after them.
#include "../scene/prototype_maker.h"

#include <fmt/format.h>

#include <rtsg/core/loader.h>
#include <rtsg/core/scene_builder.h>

namespace rtsg::detail {

namespace {

/// Of `Name#2`, the second prototype of that name that the scene has met: `Name`.
std::string_view declaredName(const NodeType& type) {
    return std::string_view(type.name).substr(0, type.name.find('#'));
}

bool mentions(std::string_view text, std::string_view word) {
    const auto isPart = [](char c) { return c > ' ' && !std::string_view("{}[]\"',#.").contains(c); };
    for (auto at = text.find(word); at != text.npos; at = text.find(word, at + 1)) {
        const std::size_t end = at + word.size();
        if ((at == 0 || !isPart(text[at - 1])) && (end == text.size() || !isPart(text[end]))) return true;
    }
    return false;
}

/// The declaration of `wanted`, after those of the prototypes that it is made of, in the order in which they came.
std::string declarations(const Scene& scene, const NodeType& wanted) {
    std::vector<const NodeType*> kept{&wanted};
    for (std::size_t i = scene.typeCount(); i-- > builtinTypes().size();) {
        const NodeType& type = scene.type(TypeIndex{static_cast<std::uint16_t>(i)});
        const bool isPrototype = type.kind == NodeType::Kind::proto || type.kind == NodeType::Kind::externProto;
        if (!isPrototype || type.declaration.empty() || type.name.contains('#')) continue;
        if (declaredName(type) == declaredName(wanted)) continue;
        for (const NodeType* user : kept)
            if (mentions(user->declaration, type.name)) {
                kept.push_back(&type);
                break;
            }
    }
    std::string text;
    for (std::size_t i = kept.size(); i-- > 0;) text += kept[i]->declaration + '\n';
    return text;
}

}  // namespace

Result<NodeId> makePrototypeInstance(Scene& scene, TypeIndex type, NodeId scope, const Resources* resources) {
    const NodeType& wanted = scene.type(type);
    if (wanted.declaration.empty())
        return fail(fmt::format("{} is declared inside of another prototype: it can only be made there", wanted.name));
    const std::string text =
        fmt::format("#X3D V4.0 utf8\n{}\n{} {{ }}\n", declarations(scene, wanted), declaredName(wanted));
    Diagnostics diagnostics{wanted.name};
    BuildOptions options;
    options.resources = resources ? *resources : Resources();
    options.detached = true;
    options.scope = scope;
    SceneBuilder builder(scene, diagnostics, options);
    readDocument(text, builder, diagnostics);
    builder.finish();
    if (builder.roots().size() == 1 && scene.node(builder.roots()[0]).typeIndex() == type) return builder.roots()[0];
    for (const NodeId made : builder.roots())
        if (auto gone = scene.destroyNode(made); !gone) return std::unexpected(std::move(gone.error()));
    for (const Diagnostic& d : diagnostics.all())
        if (d.severity == Severity::error) return fail(fmt::format("{} cannot be made: {}", wanted.name, d.format()));
    return fail(fmt::format("{} cannot be made from its declaration", wanted.name));
}

}  // namespace rtsg::detail
