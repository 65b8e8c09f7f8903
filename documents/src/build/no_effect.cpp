// Names the types of nodes that hold their fields and do nothing, once for each file, if a document has one.
#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "builder_state.h"

namespace rtsg {

namespace {

struct WithoutEffect {
    const char *type, *outcome;
};

// By name: a shader with fields of its own is of a type of its own.
constexpr WithoutEffect kWithoutEffect[] = {
    {"ComposedShader", "has no effect: shaders are not run, the material beside it is drawn in its place"},
    {"PackagedShader", "has no effect: shaders are not run, the material beside it is drawn in its place"},
    {"ProgramShader", "has no effect: shaders are not run, the material beside it is drawn in its place"},
    {"FloatVertexAttribute", "has no effect: it is for shaders, which are not run"},
    {"Matrix3VertexAttribute", "has no effect: it is for shaders, which are not run"},
    {"Matrix4VertexAttribute", "has no effect: it is for shaders, which are not run"},
    {"NurbsSet", "has no effect: its surfaces are cut each for itself"},
};

}  // namespace

void SceneBuilder::State::reportOfNoEffect(NodeId id, SourceLocation where) {
    const NodeType& type = scene.node(id).type();
    if (isTrial || type.kind == NodeType::Kind::proto) return;
    for (const WithoutEffect& row : kWithoutEffect) {
        if (type.name != row.type) continue;
        if (!withoutEffect.emplace(scope().source, row.type).second) return;
        const std::string_view name = scene.name(id);
        warning(where, fmt::format("{}{}{} {}", row.type, name.empty() ? "" : " ", name, row.outcome));
        return;
    }
}

}  // namespace rtsg
