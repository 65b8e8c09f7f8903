// Draws what Dear ImGui wants drawn into pixels of the processor's: triangles with colours and one texture.
//
// Threading: pure functions.
#pragma once

#include <cstdint>

#include <imgui.h>

namespace rtsg {

/// Rows of B, G, R, X from the top, `stride` bytes each.
struct PixelRows {
    std::uint8_t* pixels = nullptr;
    int width = 0, height = 0, stride = 0;
};
/// The atlas of fonts: how much of each texel is covered, 0 to 255.
struct Coverage {
    const std::uint8_t* texels = nullptr;
    int width = 0, height = 0;
};

/// Every command draws with `atlas`, whatever texture it names.
void draw(const ImDrawData& data, const Coverage& atlas, const PixelRows& target);

}  // namespace rtsg
