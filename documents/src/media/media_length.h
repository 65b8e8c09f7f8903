// How long a sound or a film plays, read off its header.
//
// Source: RIFF WAVE (Multimedia Programming Interface and Data Specifications 1.0, 1991); ISO/IEC 14496-12 8.2.2
// (mvhd).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

namespace rtsg {

/// A file that is read in parts: films are long, and only short pieces are needed.
struct MediaBytes {
    std::uint64_t size = 0;
    /// So many bytes from there on; fewer where the file ends.
    std::function<std::string(std::uint64_t offset, std::size_t length)> read;
};

/// The seconds of a WAVE file or one of the MP4 family. Nothing for other files, for broken ones, and if more than ten
/// thousand chunks come before the header.
std::optional<double> mediaSeconds(const MediaBytes& file);

}  // namespace rtsg
