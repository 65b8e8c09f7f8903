// Pieces: the files of a rotated log, NAME.0001.rlog and so on beside NAME.rlog.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include <rtsg/sync/dictionary.h>

namespace rtsg {

/// Numbers of pieces are below this and have at least four digits.
inline constexpr std::uint64_t kMaxPieces = 1'000'000;

/// All files that have the name of a piece of `file`, ordered by number.
std::vector<std::pair<std::uint64_t, std::filesystem::path>> numberedPieces(const std::filesystem::path& file);

/// The head at the beginning of a log. Nothing if it is not intact.
std::optional<StreamHead> headOf(const std::filesystem::path& file);

/// True if the file ends within the first record of a log.
bool isCutInHead(const std::filesystem::path& file);

/// The piece from which a session goes on, if the newest file `log` has none of its states. Empty if there is none.
std::filesystem::path pieceBefore(const std::filesystem::path& log);

}  // namespace rtsg
