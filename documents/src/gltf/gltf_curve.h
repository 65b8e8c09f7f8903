// A sampler of glTF's animations as keys between which everything is linear.
//
// Splines become as many lines as it takes to stay within a share of what they span: interpolators of X3D have one
// velocity a key and change it by the distances of keys, and there is none for splines of rotations. Threading: values.
// Source: glTF 2.0 (ISO/IEC 12113:2022) 3.11, appendix C (Interpolation for Animations).
#pragma once

#include <optional>
#include <vector>

#include "gltf_parts.h"

namespace rtsg::detail {

struct GltfCurve {
    std::size_t size = 0;         // numbers at a key
    std::vector<double> times;    // of the keys, seconds; two are equal where the value jumps
    std::vector<double> numbers;  // `size` a key

    const double* at(std::size_t key) const { return numbers.data() + key * size; }
};

/// Reads a sampler whose keys stand at these times; nothing, with a report, if its values do not fit. `size`: how many
/// numbers there are at a key; 0: as many as there are. `tolerance`: how far lines may be from a spline, as a share of
/// the largest difference of what it passes.
std::optional<GltfCurve> readCurve(GltfFile& file, const nlohmann::json& sampler, const std::vector<float>& times,
                                   std::size_t size, double tolerance);

}  // namespace rtsg::detail
