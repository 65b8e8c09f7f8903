// Finds names for the materials of a room's surfaces. Threading: on the scene's thread.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include <rtsg/audio/room_report.h>
#include <rtsg/core/scene.h>

namespace rtsg {

/// The materials of a room with their names and areas, the largest first; equal materials of the same name are one.
/// `nodeOf`: the node that defines a material.
std::vector<RoomReport::Material> materialsOf(const Scene& scene, const RoomSize& room,
                                              std::span<const AcousticMaterial> materials,
                                              const std::function<NodeId(std::uint32_t)>& nodeOf);

}  // namespace rtsg
