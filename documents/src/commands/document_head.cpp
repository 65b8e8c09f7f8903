// The head of a scene's document as lists of strings in the root's hidden fields.
#include "document_head.h"

#include <charconv>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

using Root = x3d::RtsgScene;

template <class T>
T numberIn(std::string_view text) {
    T value = 1;
    std::from_chars(text.data(), text.data() + text.size(), value);
    return value;
}

void append(Scene& scene, Field<Array<String>> field, const std::vector<std::string>& added) {
    if (added.empty()) return;
    Array<String> list = scene.node(scene.root()).get(field);
    for (const std::string& one : added) list.push_back(String(one));
    setHidden(scene, scene.root(), field.index, Value(std::move(list)));
}

}  // namespace

DocumentHead headOf(const Scene& scene) {
    const Node& root = scene.node(scene.root());
    DocumentHead head;
    head.profile = root.get(Root::profile).str();
    const Array<String>&components = root.get(Root::components), &meta = root.get(Root::meta),
          &units = root.get(Root::units);
    for (std::size_t i = 0; i + 1 < components.size(); i += 2)
        head.components.push_back({components[i].str(), numberIn<int>(components[i + 1])});
    for (std::size_t i = 0; i + 1 < meta.size(); i += 2) head.meta.push_back({meta[i].str(), meta[i + 1].str()});
    for (std::size_t i = 0; i + 2 < units.size(); i += 3)
        head.units.push_back({units[i].str(), units[i + 1].str(), numberIn<double>(units[i + 2])});
    return head;
}

void appendHead(Scene& scene, const DocumentHead& head) {
    const Node& root = scene.node(scene.root());
    if (!head.profile.empty() && root.isDefault(Root::profile.index))
        setHidden(scene, root.id(), Root::profile.index, Value(String(head.profile)));
    std::vector<std::string> components, meta, units;
    for (const auto& one : head.components) components.insert(components.end(), {one.name, std::to_string(one.level)});
    for (const auto& one : head.meta) meta.insert(meta.end(), {one.name, one.content});
    for (const auto& one : head.units)
        units.insert(units.end(), {one.category, one.name, fmt::format("{}", one.conversionFactor)});
    append(scene, Root::components, components);
    append(scene, Root::meta, meta);
    append(scene, Root::units, units);
}

}  // namespace rtsg
