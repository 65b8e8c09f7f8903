// Compares the columns of two frames apart from their values. In a scene in motion they are the same in frame after
// frame.
#include "superseded.h"

#include <rtsg/sync/record.h>

#include "columns/plain_columns.h"

namespace rtsg::mirror {

bool isSuperseded(std::span<const std::byte> frame, std::span<const std::byte> next) {
    wire::Reader a(frame.subspan(kRecordHeaderSize)), b(next.subspan(kRecordHeaderSize));
    while (a.left() && b.left()) {
        const std::span<const std::byte> first = wire::readRawColumn(a).keys, second = wire::readRawColumn(b).keys;
        if (first.empty() || !wire::areSame(first, second)) return false;
    }
    return !a.left() && !b.left();
}

}  // namespace rtsg::mirror
