// Superseded frames: those whose every value the next frame gives again, so that they need not be applied.
#pragma once

#include <cstddef>
#include <span>

namespace rtsg::mirror {

/// True if applying `next` alone leads to the same state as applying `frame` and then `next`: both have only raw
/// columns of plain values, for the same fields of the same nodes. Precondition: both are intact, and `next` starts
/// where `frame` ends.
bool isSuperseded(std::span<const std::byte> frame, std::span<const std::byte> next);

}  // namespace rtsg::mirror
