// Layers of a picture that hold data other than colour: depth, positions, normals, identities.
//
// DataLayer says which surface they describe. Threading: re-entrant; the pixels are filled by several threads.
// Source: Friedman & Jones 2015, Fully Automatic ID Mattes with Support for Motion Blur and Transparency, and the
// Cryptomatte specification 1.2.0 (names' hashes as floats, ranks of coverage, manifest).
#pragma once

#include <cstdint>
#include <string_view>

#include <rtsg/renderers/picture.h>

#include "lighting/trace_scene.h"

namespace rtsg::trace {

/// The layers that `settings` ask for, in which nothing is seen yet. Asks for names.
void addLayers(const RayView& world, const RenderSettings& settings, Picture& picture);

/// Fills them. Precondition: addLayers() with these settings, to a picture of tilesAround() their region.
void drawLayerData(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, Picture& picture);

/// All that a pixel's layers hold, into the same layers of another picture.
void copyLayerData(const Picture& from, std::size_t pixel, Picture& to, std::size_t index);

/// MurmurHash3 of 32 bits, seed 0 (Appleby 2011), and the float by which Cryptomatte stores it: never 0, a denormal, an
/// infinity or a NaN.
std::uint32_t murmurHash3(std::string_view text);
float cryptomatteId(std::uint32_t hash);

}  // namespace rtsg::trace
