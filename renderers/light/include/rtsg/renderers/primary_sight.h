// PrimarySight: the surfaces that a rasteriser has found at the pixels of a picture, from which rays go on; the
// interface between the two parts of a hybrid picture.
//
// A rasteriser fills one for each layer of a picture and each sample of its pixels: the frontmost instance, its depth,
// and the colour that the rasteriser gives the pixel. Rays find the surface at that depth and add shadows, mirrors,
// glass and other effects that a rasteriser leaves out. If rays would find nothing more than the rasteriser's colour,
// the colour stays and no ray is made. Invariant: the picture is the one by `whitted`, except for edges that the
// rasteriser places otherwise, and its colours. Threading: values. SurfaceState::trace() takes them. Source: paper
// section 8 (hybrid rendering).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <rtsg/renderers/ray.h>

namespace rtsg {

/// Stands for an unknown instance: something is there, and rays shall find out what.
constexpr std::uint32_t kUnnamedInstance = kNoInstance - 1;

/// One sample of each pixel of a layer (LightTracer::layers()), row by row from the top.
struct PrimarySight {
    int width = 0, height = 0;
    Vec2d position{.5, .5};                // position of the samples in their pixels, from the left and the top
    int samples = 1;                       // number of samples, of which this is one: with more samples, textures are
                                           // blurred less
    std::vector<std::uint32_t> instances;  // InstanceId::slot of the frontmost one; or kNoInstance: the background
    std::vector<float> depths;             // metres along the view, where the instance is no line or point
    /// The rasteriser's final pixel, including things behind clear surfaces: premultiplied display values.
    std::vector<Vec4f> colors;
    std::size_t at(int x, int y) const {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
    }
};

}  // namespace rtsg
