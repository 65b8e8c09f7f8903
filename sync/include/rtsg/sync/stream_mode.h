// StreamMode: the content of a stream of a mirror or log, and its coding. The head states it (PROTOCOL.md, "Head").
//
//   state  results of the cascade, bit for bit: the default
//   input  document, clock and outside events; the follower runs the same cascade
//   lossy  as state, but values in motion lie on a grid within maxError of the origin's (lossy_scene.h); at rest exact
//
// Invariant: the numbers are part of the format.
// Threading: values.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace rtsg {

enum class Mode : std::uint8_t { state = 0, input = 1, lossy = 2 };

/// How a writer packs the values of frames. Readers need no setting: every column says how it is coded.
enum class Coding : std::uint8_t {
    raw = 0,       // as they are; takes the least time
    compact = 1,   // predicted from earlier values; the differences take only the bits they need
    smallest = 2,  // as compact, with the differences through an adaptive arithmetic coder; takes the fewest bytes
};

struct StreamMode {
    Mode mode = Mode::state;
    Coding coding = Coding::raw;
    /// Only for Mode::lossy, > 0. In metres for positions, radians for rotations, and the field's own unit for other
    /// floats.
    double maxError = 0;
    friend bool operator==(const StreamMode&, const StreamMode&) = default;
};

constexpr std::array<std::string_view, 3> kModeNames = {"state", "input", "lossy"};
constexpr std::array<std::string_view, 3> kCodingNames = {"raw", "compact", "smallest"};

constexpr std::string_view nameOf(Mode mode) {
    return kModeNames[static_cast<std::size_t>(mode)];
}
constexpr std::string_view nameOf(Coding coding) {
    return kCodingNames[static_cast<std::size_t>(coding)];
}
constexpr std::optional<Mode> modeFromName(std::string_view name) {
    for (std::size_t i = 0; i < kModeNames.size(); ++i)
        if (kModeNames[i] == name) return static_cast<Mode>(i);
    return std::nullopt;
}
constexpr std::optional<Coding> codingFromName(std::string_view name) {
    for (std::size_t i = 0; i < kCodingNames.size(); ++i)
        if (kCodingNames[i] == name) return static_cast<Coding>(i);
    return std::nullopt;
}

}  // namespace rtsg
