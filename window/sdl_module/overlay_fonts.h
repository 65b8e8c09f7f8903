// The overlay's letters: an atlas with what the texts at hand need, and the order in which right-to-left letters stand.
//
// The first font has Latin, Greek, Cyrillic and Hebrew. For other letters fontconfig names fonts, which are added when
// a text first needs them. Letters are not joined, so Arabic stands in its single forms. Threading: one thread, and
// make() between ImGui's frames. Source: Unicode Standard Annex 9, without embeddings, with lines that run to the
// right.
#pragma once

#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <imgui.h>

namespace rtsg {

class OverlayFonts {
  public:
    /// `size`: of the letters, pixels.
    explicit OverlayFonts(float size) : size_(size) {}
    /// Notes the letters of a text.
    void need(std::string_view text);
    /// Makes the atlas, if it lacks letters that were noted since. Returns whether it was made.
    bool make(ImFontAtlas& atlas);

  private:
    void addFallbacks(ImFontAtlas& atlas, const std::set<char32_t>& missing);

    const float size_;
    bool isBuilt_ = false;
    std::set<char32_t> needed_, tried_;         // beyond the first font's ranges
    std::vector<std::vector<ImWchar>> ranges_;  // of the atlas, which reads them when it is built
};

/// The text with its right-to-left runs turned round, as it stands on a line.
std::string visual(const std::string& text);

}  // namespace rtsg
