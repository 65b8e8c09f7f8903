// Profiles and their components, and which nodes may stand at the top of a document.
#include <algorithm>
#include <array>
#include <map>

#include <rtsg/documents/document_handler.h>

#include "document_check.h"
#include "suggestion.h"

namespace rtsg::detail {

namespace {

struct Level {
    std::string_view component;
    int level;
};
struct ProfileRow {
    std::string_view name;
    std::array<Level, 24> components;  // filled up with nothing
};

// ISO/IEC 19775-1 V4.0, annexes A to G, of each the table of components and levels; where the object model of X3D 4.0
// lists more nodes for a profile, the levels of those.
constexpr std::array kProfiles = std::to_array<ProfileRow>({
    {"Core", {{{"Core", 1}}}},
    {"Interchange",
     {{{"Core", 1},
       {"Time", 1},
       {"Networking", 1},
       {"Grouping", 1},
       {"Rendering", 3},
       {"Shape", 1},
       {"Geometry3D", 2},
       {"Lighting", 1},
       {"Texturing", 2},
       {"Interpolation", 2},
       {"Navigation", 1},
       {"EnvironmentalEffects", 1}}}},
    {"CADInterchange",
     {{{"Core", 1},
       {"Networking", 2},
       {"Grouping", 1},
       {"Rendering", 4},
       {"Shape", 2},
       {"Lighting", 1},
       {"Texturing", 2},
       {"Navigation", 2},
       {"Shaders", 1},
       {"CADGeometry", 2}}}},
    {"Interactive",
     {{{"Core", 1},
       {"Time", 1},
       {"Networking", 2},
       {"Grouping", 2},
       {"Rendering", 3},
       {"Shape", 1},
       {"Geometry3D", 3},
       {"Lighting", 2},
       {"Texturing", 2},
       {"Interpolation", 2},
       {"PointingDeviceSensor", 1},
       {"KeyDeviceSensor", 2},
       {"EnvironmentalSensor", 2},
       {"Navigation", 1},
       {"EnvironmentalEffects", 1},
       {"EventUtilities", 1}}}},
    {"MPEG4Interactive",
     {{{"Core", 1},
       {"Time", 1},
       {"Networking", 2},
       {"Grouping", 2},
       {"Rendering", 1},
       {"Shape", 1},
       {"Geometry3D", 3},
       {"Lighting", 2},
       {"Texturing", 1},
       {"Interpolation", 2},
       {"PointingDeviceSensor", 1},
       {"EnvironmentalSensor", 1},
       {"Navigation", 1},
       {"EnvironmentalEffects", 1}}}},
    {"Immersive",
     {{{"Core", 2},
       {"Time", 1},
       {"Networking", 3},
       {"Grouping", 2},
       {"Rendering", 3},
       {"Shape", 2},
       {"Geometry3D", 4},
       {"Geometry2D", 1},
       {"Text", 1},
       {"Sound", 1},
       {"Lighting", 2},
       {"Texturing", 3},
       {"Interpolation", 2},
       {"PointingDeviceSensor", 1},
       {"KeyDeviceSensor", 2},
       {"EnvironmentalSensor", 2},
       {"Navigation", 2},
       {"EnvironmentalEffects", 2},
       {"EventUtilities", 1},
       {"Scripting", 1}}}},
    {"MedicalInterchange",
     {{{"Core", 1},
       {"Time", 1},
       {"Networking", 2},
       {"Grouping", 3},
       {"Rendering", 5},
       {"Shape", 3},
       {"Geometry3D", 2},
       {"Geometry2D", 2},
       {"Text", 1},
       {"Lighting", 1},
       {"Texturing", 2},
       {"Texturing3D", 2},
       {"Interpolation", 2},
       {"Navigation", 3},
       {"EnvironmentalEffects", 1},
       {"EventUtilities", 1},
       {"VolumeRendering", 4}}}},
});

bool isBuiltinComponent(std::string_view name) {
    return std::ranges::any_of(builtinTypes(), [&](const auto& type) { return type->component == name; });
}

}  // namespace

void ProfileCheck::profile(std::string_view name, SourceLocation where, Diagnostics& diagnostics) {
    if (name == "MPEG-4") name = "MPEG4Interactive";
    profile_ = name;
    everything_ = name.empty() || name == "Full";
    if (everything_) return;
    const auto found = std::ranges::find(kProfiles, name, &ProfileRow::name);
    if (found == kProfiles.end()) {
        std::vector<std::string_view> known{"Full"};
        for (const ProfileRow& one : kProfiles) known.push_back(one.name);
        diagnostics.warning(where, "there is no profile " + profile_ + didYouMean(name, known),
                            DiagnosticCode("profile"));
        everything_ = true;
        return;
    }
    for (const Level& one : found->components)
        if (one.level) supported_.push_back({std::string(one.component), one.level});
}

void ProfileCheck::component(std::string_view name, int level, SourceLocation where, Diagnostics& diagnostics) {
    if (name == "H-Anim") name = "HAnim";  // its name in X3D 3
    if (!isBuiltinComponent(name)) {
        std::vector<std::string_view> known;
        for (const auto& type : builtinTypes())
            if (!type->internal) known.push_back(type->component);
        diagnostics.warning(where, "there is no component " + std::string(name) + didYouMean(name, known),
                            DiagnosticCode("profile"));
        return;
    }
    const auto found = std::ranges::find(supported_, name, &Support::component);
    if (found == supported_.end())
        supported_.push_back({std::string(name), level});
    else
        found->level = std::max(found->level, level);
}

void ProfileCheck::node(const NodeType& type, SourceLocation where, Diagnostics& diagnostics) {
    if (everything_ || type.internal) return;
    const auto found = std::ranges::find(supported_, type.component, &Support::component);
    const int has = found == supported_.end() ? 0 : found->level;
    if (has >= type.level) return;
    const std::string wanted = type.component + ":" + std::to_string(type.level);
    if (std::ranges::find(reported_, wanted) != reported_.end()) return;
    reported_.push_back(wanted);
    diagnostics.warning(
        where,
        type.name + " is of component " + type.component + ", level " + std::to_string(type.level) + "; profile " +
            profile_ +
            (has ? " and the components named reach level " + std::to_string(has) : std::string(" has none of it")) +
            " (COMPONENT " + wanted + " is missing)",
        DiagnosticCode("profile"));
}

std::string notAtTheTop(const NodeType& type) {
    for (const char* child : {"X3DChildNode", "X3DMetadataObject", "X3DLayerSetNode", "X3DLayerNode"})
        if (type.isA(child)) return {};
    if (type.name == "LayerSet") return {};
    std::string location;
    for (const auto& parent : builtinTypes()) {
        const FieldIndex field = parent->internal ? kNoField : parent->findExact(type.containerField);
        if (field == kNoField || parent->fields[field].accepts.empty()) continue;
        if (std::ranges::none_of(parent->fields[field].accepts,
                                 [&](const std::string& accepted) { return type.isA(accepted); }))
            continue;
        // The shortest name is the plainest parent: Shape, not ParticleSystem.
        if (location.empty() || parent->name.size() < location.size()) location = parent->name;
    }
    std::string text = type.name + " does nothing at the top of a scene";
    if (!location.empty())
        text += "; it belongs in field " + type.containerField +
                (std::string_view("AEIO").contains(location[0]) ? " of an " : " of a ") + location;
    return text;
}

}  // namespace rtsg::detail

namespace rtsg {

std::vector<DocumentHead::Component> supportedComponents() {
    std::map<std::string, int> levels;
    for (const auto& type : builtinTypes())
        if (!type->internal) levels[type->component] = std::max(levels[type->component], type->level);
    std::vector<DocumentHead::Component> result;
    for (const auto& [name, level] : levels) result.push_back({name, level});
    return result;
}

std::vector<Profile> supportedProfiles() {
    std::vector<Profile> result;
    for (const detail::ProfileRow& row : detail::kProfiles) {
        Profile& profile = result.emplace_back(std::string(row.name), std::vector<DocumentHead::Component>());
        for (const detail::Level& one : row.components)
            if (!one.component.empty()) profile.components.push_back({std::string(one.component), one.level});
    }
    result.push_back({"Full", supportedComponents()});
    return result;
}

}  // namespace rtsg
