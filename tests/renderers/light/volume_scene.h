// Volumes as ClassicVRML text, for the tests of them.
#pragma once

#include <functional>
#include <string>

#include <fmt/format.h>

#include "light_scene.h"

namespace rtsg::test {

/// A PixelTexture3D of one component, from the lowest corner on.
inline std::string voxels(int nx, int ny, int nz, const std::function<int(int, int, int)>& value) {
    std::string image = fmt::format("PixelTexture3D {{ image [ 1 {} {} {}", nx, ny, nz);
    for (int z = 0; z < nz; ++z)
        for (int y = 0; y < ny; ++y)
            for (int x = 0; x < nx; ++x) image += fmt::format(" {}", value(x, y, z));
    return image + " ] }";
}
inline std::string evenVoxels(int value, int nx, int ny, int nz) {
    return voxels(nx, ny, nz, [&](int, int, int) { return value; });
}
/// Two metres wide about the origin.
inline std::string volume(const std::string& texture, const std::string& style = "", const char* dimensions = "2 2 2") {
    return fmt::format("VolumeData {{ dimensions {} voxels {} {} }}\n", dimensions, texture,
                       style.empty() ? "" : "renderStyle " + style);
}
/// With a transfer function of these words.
inline std::string opacityMap(const std::string& image) {
    return "OpacityMapVolumeStyle { transferFunction PixelTexture { image " + image + " } }";
}
/// A large square of one colour, this far behind the origin.
inline std::string behind(double distance, const char* color) {
    return fmt::format("Transform {{ translation 0 0 {} children {} }}\n", -distance, square(9, unlit(color)));
}

}  // namespace rtsg::test
