// Blame: who changed a field, when, and by which routes, as a log tells it.
//
// Invariant: nothing is guessed: an author is named only where the log has one, a route only where the field that it
// comes from changed in the same state. Threading: pure functions.
// Source: ISO/IEC 19775-1 V4.0, 4.4.8 (event model).
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/sync/replay.h>

namespace rtsg {

/// A field has got another value.
struct FieldStep {
    std::uint64_t state = 0;
    double time = 0;  // seconds
    std::string value;
    /// Who asked for it, or for what it followed from (ChangeSet::authors); empty: the application, or time itself.
    std::string author;
    /// "set from outside", "from a pointer", "ROUTE A.x > B.y", one followed by the other; "in state 7" if that set off
    /// a node that acts over time; "came into the part" where the log is of a part of the scene and the node was not in
    /// it before, "came into the scene" where it cannot tell; empty where the log cannot tell anything.
    std::string cause;
    bool wasSet = false;  // from outside, or with its node: nothing in the scene led there
};

/// The states of a log in which a field (as findField() has it) had another value than in the state before; the first
/// is that with which it begins. `progress` is told bytes read and all there are; false ends it. Errors: the log cannot
/// be read, or has no such field in any state. `lacks`: where the log first was not whole, if it was not: changes may
/// be missing, and what led to others. `piece`: that it is a later piece of its session, if it is: what led to the
/// first value is elsewhere.
Result<std::vector<FieldStep>> blame(const std::filesystem::path& log, std::string_view path,
                                     const std::function<bool(std::uint64_t, std::uint64_t)>& progress = {},
                                     std::optional<Divergence>* lacks = nullptr,
                                     std::optional<LaterPiece>* piece = nullptr);

}  // namespace rtsg
