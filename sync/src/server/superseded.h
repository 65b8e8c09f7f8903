// Which frames need not be followed one by one: those whose every value the next frame gives again.
#pragma once

#include <cstddef>
#include <span>

namespace rtsg::mirror {

/// Whether applying `next` alone leads to the state that applying `frame` and then `next` does: both hold raw columns
/// of plain values only, of the same fields of the same nodes. Both intact, `next` from the state that `frame` leads
/// to.
bool isSuperseded(std::span<const std::byte> frame, std::span<const std::byte> next);

}  // namespace rtsg::mirror
