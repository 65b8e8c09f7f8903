// Writes clips of a scene as glTF animations: the Transforms that a TimeSensor moves through interpolators.
//
// Threading: the scene's thread. Source: glTF 2.0 (ISO/IEC 12113:2022) 3.11; ISO/IEC 19775-1 V4.0 19.3, 19.4.
#pragma once

#include <set>
#include <string>
#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg::mesh_files {

/// The values of one field of a Transform over time; rotations are quaternions (x y z w).
struct GlbChannel {
    NodeId transform;
    std::string path;           // translation, rotation or scale
    std::vector<float> times;   // seconds, each later than the one before
    std::vector<float> values;  // 3 or 4 a time
};
struct GlbClip {
    std::string name;
    std::vector<GlbChannel> channels;
};

/// The clips in the order of their clocks. `leftOut` counts other motion by clocks: by other interpolators, and of
/// fields of other nodes.
std::vector<GlbClip> findClips(const Scene& scene, std::size_t& leftOut);

}  // namespace rtsg::mesh_files
