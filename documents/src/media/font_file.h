// isFontFile: whether bytes have the form of a font, before anything is made of them.
//
// What is looked at is the directory of tables alone: that each lies within the file, and that those are there without
// which no glyph has a form. What is in the tables is for the library that draws them. Threading: pure.
// Source: ISO/IEC 14496-22 (Open Font Format) 4.5, W3C WOFF 1.0 section 3 and WOFF 2.0 section 4.
#pragma once

#include <string>
#include <string_view>

namespace rtsg::detail {

/// TrueType and OpenType fonts, collections of them, WOFF and WOFF2. `why`: else what is wrong, as a clause.
bool isFontFile(std::string_view bytes, std::string& why);

}  // namespace rtsg::detail
