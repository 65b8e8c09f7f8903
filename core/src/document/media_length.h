// How long a sound or a film plays, read off its header.
//
// Source: RIFF WAVE (Multimedia Programming Interface and Data Specifications 1.0, 1991); ISO/IEC 14496-12 8.2.2
// (mvhd).
#pragma once

#include <optional>
#include <string_view>

namespace rtsg {

/// Seconds, of a WAVE file or one of the MP4 family; nothing for all else and for what is broken.
std::optional<double> mediaSeconds(std::string_view bytes);

}  // namespace rtsg
