// Draws the texts of a map into its picture, with letters of five by seven dots. Threading: a pure function.
#pragma once

#include <string_view>

#include <rtsg/renderers/picture.h>

namespace rtsg {

/// Pixels of one dot of a letter, and from a letter to the next.
inline constexpr int kMapDot = 2, kMapLetter = 6 * kMapDot, kMapLetterHeight = 7 * kMapDot;

/// Starts at the upper left corner; unknown letters, and parts outside the picture, are left out.
void drawMapText(Picture& picture, int x, int y, std::string_view text, const Vec4f& color);

}  // namespace rtsg
