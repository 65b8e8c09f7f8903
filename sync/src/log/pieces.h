// The pieces of a rotated log as files: NAME.0001.rlog and so on beside NAME.rlog.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include <rtsg/sync/dictionary.h>

namespace rtsg {

/// Numbers of pieces are below; of four digits at least.
inline constexpr std::uint64_t kMostPieces = 1'000'000;

/// All files whose names are those of pieces of `file`, by their numbers.
std::vector<std::pair<std::uint64_t, std::filesystem::path>> numberedPieces(const std::filesystem::path& file);

/// What a log begins with; nothing if that is no intact head.
std::optional<StreamHead> headOf(const std::filesystem::path& file);

/// A file that ends within the first record of a log.
bool isCutInHead(const std::filesystem::path& file);

/// The piece that a session goes on from if not one state of it is in `log`, its newest file; empty: there is none.
std::filesystem::path pieceBefore(const std::filesystem::path& log);

}  // namespace rtsg
