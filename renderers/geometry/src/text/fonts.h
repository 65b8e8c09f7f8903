// Fonts: strings to glyphs with their places, and glyphs to outlines, by a module (librtsg_fonts.so) that is loaded
// when the first Text is drawn: programs without text wait for none of its libraries.
//
// Invariant: nothing of FreeType, fontconfig or HarfBuzz is on this side; the module links nothing of ours. All lengths
// are in ems: 1 is the nominal size of the font. A face's number stays valid until the process ends.
// Threading: every function may be called from any thread.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

struct FontRequest {
    std::vector<std::string> families;  // as FontStyle has them, the first that is installed wins
    bool bold = false, italic = false;
    /// A face that load() gave stands for families[loadedAt], as it is: neither bold nor slanted by itself.
    static constexpr std::uint32_t kNone = 0xFFFFFFFF;
    std::uint32_t loaded = kNone, loadedAt = 0;
};

/// A face that stands for a request; `said`: why it is another than was asked for; empty if it is not.
struct FontChoice {
    std::uint32_t face = 0;
    float ascent = 0, descent = 0;  // of lines, above and below the baseline; both count positive
    std::string said;
};

/// One glyph on a line that starts at 0 and grows to the right.
struct PlacedGlyph {
    std::uint32_t face = 0, glyph = 0;  // the face is another where the one asked for lacks the character
    float x = 0, y = 0;
};
struct ShapedLine {
    std::vector<PlacedGlyph> glyphs;
    float width = 0;
    std::uint32_t missing = 0;  // characters that no installed font has
};

/// A closed outline of straight lines and Bezier curves. `segments[i]` says how many points lead on from the last one:
/// 1 a line, 2 a quadratic, 3 a cubic curve, its end included. The first point is the start.
struct GlyphContour {
    std::vector<float> points;  // x, y
    std::vector<std::uint8_t> segments;
};

/// The rectangle that a glyph fills, from its origin: left to right, bottom to top.
struct GlyphBox {
    float left = 0, bottom = 0, right = 0, top = 0;
    bool empty = true;  // of blanks
};

class Fonts {
  public:
    virtual ~Fonts() = default;
    /// The face in a font's file; bytes that were loaded before have the face that they had. Error, in the returned
    /// clause: no font, or one more than are kept (kMaxLoaded, kMaxBytes in all).
    virtual std::string load(std::string_view file, std::uint32_t& face) const = 0;
    static constexpr std::size_t kMaxLoaded = 256, kMaxBytes = std::size_t{256} << 20;
    /// Error, in the returned sentence: there is no font at all.
    virtual std::string choose(const FontRequest& request, FontChoice& out) const = 0;
    /// `text`: UTF-8; invalid bytes count as U+FFFD. Characters run to the right, or to the left; those of
    /// right-to-left scripts always to the left. `language`: a BCP 47 tag, or empty.
    virtual void shape(std::uint32_t face, const std::string& text, const std::string& language, bool leftToRight,
                       ShapedLine& out) const = 0;
    /// To be filled by the nonzero rule. Empty for blanks.
    virtual void outline(std::uint32_t face, std::uint32_t glyph, std::vector<GlyphContour>& out) const = 0;
    /// To a unit of the font, 1/1000 or 1/2048 of an em.
    virtual GlyphBox box(std::uint32_t face, std::uint32_t glyph) const = 0;
    /// Whether scripts are shaped (HarfBuzz); else characters stand one after the other.
    virtual bool shapes() const = 0;
};

/// The module's; loads it at the first call. Error: it was left out of this build, or it is not where programs look for
/// libraries (beside the program, ../lib/rtsg, LD_LIBRARY_PATH).
Result<const Fonts*> fonts();

/// The name that the module exports; it changes whenever this header does.
#define RTSG_FONTS_SYMBOL rtsgFonts3

}  // namespace rtsg
