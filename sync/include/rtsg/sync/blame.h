// Blame: finds in a log who changed a field, when, and by which routes.
//
// Invariant: nothing is guessed. An author is named only if the log has one, a route only if its source field changed
// in the same state.
// Threading: pure functions. Source: ISO/IEC 19775-1 V4.0, 4.4.8 (event model).
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

/// One change of a field's value.
struct FieldStep {
    std::uint64_t state = 0;
    double time = 0;  // seconds
    std::string value;
    /// Who asked for the change or its cause (ChangeSet::authors). Empty: the application, or time itself.
    std::string author;
    /// How it came about: "set from outside", "from a pointer", "ROUTE A.x > B.y", one after the other. "in state 7"
    /// follows if that state set off a node that acts over time. "came into the part" if the log is of a part of the
    /// scene that did not have the node before; "came into the scene" if the log cannot tell that. Empty if the log
    /// cannot tell anything.
    std::string cause;
    bool wasSet = false;  // it was set from outside or came with its node, so no cause is in the scene
};

/// Lists the states of a log in which a field (named as for findField()) changed its value; the first entry is its
/// first value. `progress` gets the bytes read and their total; if it returns false the search ends. `lacks` gets the
/// first place where the log is incomplete, so that changes or their causes may be missing. `piece` is set if the log
/// is a later piece of its session, so that the cause of the first value is elsewhere. Errors: the log cannot be read,
/// or no state of it has the field.
Result<std::vector<FieldStep>> blame(const std::filesystem::path& log, std::string_view path,
                                     const std::function<bool(std::uint64_t, std::uint64_t)>& progress = {},
                                     std::optional<Divergence>* lacks = nullptr,
                                     std::optional<LaterPiece>* piece = nullptr);

}  // namespace rtsg
