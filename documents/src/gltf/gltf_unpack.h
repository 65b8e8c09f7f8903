// Compressed data of glTF: meshes by Draco and buffer views by meshopt, unpacked by the modules librtsg_draco.so and
// librtsg_meshopt.so, which are loaded when a file needs them.
//
// Invariant: the modules link nothing of ours and throw nothing; what a file counts is checked before memory is taken
// for it. Threading: any thread.
// Source: KHR_draco_mesh_compression (Draco bitstream 2.2), EXT_meshopt_compression.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg::detail {

/// Values of one attribute for each point, one after the other, in a component type of glTF (5120 to 5126).
struct DracoAttribute {
    std::uint32_t id = 0;  // that Draco knows it by
    std::size_t componentType = 0, components = 0;
    std::string bytes;  // the unpacked bytes
};
struct DracoMesh {
    std::size_t points = 0, indices = 0;  // as the accessors count them; another number is an error
    std::vector<DracoAttribute> attributes;
    std::string indexBytes;  // 32 bits each
};
/// Limits of unpacking: bytes in all, and a function that says whether the process may hold more.
struct UnpackLimits {
    std::uint64_t maximum = 0;
    bool (*mayHold)(std::uint64_t more) = nullptr;
};

struct MeshoptView {
    enum class Mode : std::uint8_t { attributes, triangles, indices };
    enum class Filter : std::uint8_t { none, octahedral, quaternion, exponential };
    std::string_view bytes;
    std::size_t count = 0, stride = 0;  // elements, and bytes of each
    Mode mode = Mode::attributes;
    Filter filter = Filter::none;
};

/// The symbols of the modules: functions that return why it cannot be unpacked, or null.
using UnpackDraco = const char* (*)(std::string_view bytes, DracoMesh& mesh, const UnpackLimits& limits);
using UnpackMeshopt = const char* (*)(const MeshoptView& view, std::string& out);
#define RTSG_DRACO_SYMBOL "rtsg_unpack_draco_1"
#define RTSG_MESHOPT_SYMBOL "rtsg_unpack_meshopt_1"

/// Errors: no such module, or a build without it.
Result<UnpackDraco> dracoModule();
Result<UnpackMeshopt> meshoptModule();

/// Whether a view's counts, filter and stride fit each other and its bytes; null, or the fault.
const char* misfit(const MeshoptView& view);

}  // namespace rtsg::detail
