// Which kinds of nodes pictures leave out, and what is seen instead.
#include "undrawn.h"

#include <fmt/format.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

struct Row {
    TypeIndex type;
    std::string_view outcome;
};

constexpr std::string_view kPlain = "things show without it", kShader = "the material beside it is drawn in its place";
constexpr Row kRows[] = {
    {x3d::FontLibrary::type, kPlain},     {x3d::NurbsSet::type, "its surfaces are cut each for itself"},
    {x3d::ComposedShader::type, kShader}, {x3d::PackagedShader::type, kShader},
    {x3d::ProgramShader::type, kShader},
};

}  // namespace

Undrawn::Undrawn() {
    for (const Row& row : kRows) {
        if (row.type.value >= outcome_.size()) outcome_.resize(row.type.value + 1u);
        outcome_[row.type.value] = row.outcome;
    }
}

void Undrawn::follow(const Scene& scene, const ChangeSet& changes, Diagnostics& into) {
    for (const Change& change : changes.changes) {
        if (change.kind != ChangeKind::createNode || change.index >= outcome_.size()) continue;
        std::string_view& outcome = outcome_[change.index];
        if (outcome.empty()) continue;
        const Node* node = scene.find(change.node);
        if (!node) continue;
        const std::string_view name = scene.name(node->id());
        into.warning({}, fmt::format("{}{}{} is not in pictures: {}", node->type().name, name.empty() ? "" : " ", name,
                                     outcome));
        outcome = {};
    }
}

}  // namespace rtsg
