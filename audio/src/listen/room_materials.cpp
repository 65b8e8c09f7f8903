// Names the materials of a room by DEF names of their nodes or shapes, or else by their lines.
#include "room_materials.h"

#include <algorithm>
#include <filesystem>
#include <string>
#include <unordered_map>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

namespace rtsg {
namespace {

/// The owner of each node: the Appearance for AcousticProperties and Materials, the Shape for Appearances; the first of
/// each.
std::unordered_map<std::uint32_t, NodeId> ownersIn(const Scene& scene) {
    std::unordered_map<std::uint32_t, NodeId> owners;
    scene.forEachNode([&](const Node& node) {
        const auto owns = [&](NodeId id) {
            if (id) owners.try_emplace(id.value, node.id());
        };
        if (node.is(x3d::Appearance::type)) {
            owns(node.get(x3d::Appearance::acousticProperties));
            owns(node.get(x3d::Appearance::material));
        } else if (node.is(x3d::Shape::type)) {
            owns(node.get(x3d::Shape::appearance));
        }
    });
    return owners;
}

std::string nameOfMaterial(const Scene& scene, NodeId node, const std::unordered_map<std::uint32_t, NodeId>& owners) {
    if (!node) return "without AcousticProperties";
    for (NodeId id = node;;) {
        if (const std::string_view name = scene.name(id); !name.empty()) return std::string(name);
        const auto owner = owners.find(id.value);
        if (owner == owners.end()) break;
        id = owner->second;
    }
    const NodeLocation location = scene.locationOf(node);
    if (location.where.line > 0)
        return fmt::format("{}:{}", std::filesystem::path(location.file).filename().string(), location.where.line);
    const Node* found = scene.find(node);
    return found ? fmt::format("{}#{}", found->type().name, node.value) : "unnamed";
}

}  // namespace

std::vector<RoomReport::Material> materialsOf(const Scene& scene, const RoomSize& room,
                                              std::span<const AcousticMaterial> materials,
                                              const std::function<NodeId(std::uint32_t)>& nodeOf) {
    std::vector<RoomReport::Material> named;
    const auto owners = ownersIn(scene);
    for (const RoomSize::Surface& surface : room.surfaces) {
        const AcousticMaterial& material = materials[surface.material];
        std::string name = nameOfMaterial(scene, nodeOf(surface.material), owners);
        const auto same = std::ranges::find_if(
            named, [&](const RoomReport::Material& other) { return other.name == name && other.material == material; });
        if (same != named.end())
            same->area += surface.area;
        else
            named.push_back({std::move(name), surface.area, material});
    }
    std::ranges::stable_sort(named, std::greater(), &RoomReport::Material::area);
    return named;
}

}  // namespace rtsg
