// PrimarySight: what a rasteriser has seen through the pixels of a picture, from where rays go on: the interface
// between the two of a hybrid picture.
//
// Whoever rasterises fills one for each layer of a picture and each sample of its pixels: the instance that is in front
// of all others, how far it is, and the colour that the rasteriser gives the pixel. Rays find the surface at that depth
// and what is to be seen in it: shadows, mirrors, glass, and whatever else a rasteriser leaves out. Where they would
// find nothing more than the rasteriser's colour, that stays and no ray is made.
// Invariant: the picture is the one by `whitted`, but for edges that the rasteriser places otherwise, and its colours.
// Threading: values. SurfaceState::trace() takes them. Source: paper section 8 (hybrid rendering).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <rtsg/renderers/ray.h>

namespace rtsg {

/// In place of an instance: something is there, and rays shall find out what.
constexpr std::uint32_t kUnnamedInstance = kNoInstance - 1;

/// One sample of each pixel of a layer (LightTracer::layers()), row by row from the top.
struct PrimarySight {
    int width = 0, height = 0;
    Vec2d place{.5, .5};                   // of the samples in their pixels, from the left and the top
    int samples = 1;                       // of which this is one: textures are blurred the less the more there are
    std::vector<std::uint32_t> instances;  // InstanceId::slot of the frontmost one; or kNoInstance: the background
    std::vector<float> depths;             // metres along the view, where there is an instance that is no line or point
    /// The rasteriser's whole pixel, with what is behind clear surfaces: premultiplied display values.
    std::vector<Vec4f> colors;
    std::size_t at(int x, int y) const {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
    }
};

}  // namespace rtsg
