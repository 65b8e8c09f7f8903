// The pieces of a rotated log as files: NAME.0001.rlog and so on beside NAME.rlog.
#pragma once

#include <cstdint>
#include <filesystem>
#include <utility>
#include <vector>

namespace rtsg {

/// All files whose names are those of pieces of `file`, by their numbers.
std::vector<std::pair<std::uint64_t, std::filesystem::path>> numberedPieces(const std::filesystem::path& file);

}  // namespace rtsg
