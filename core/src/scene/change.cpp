// Clears a set of changes for reuse.
#include <rtsg/core/change.h>

namespace rtsg {

void ChangeSet::clear() {
    from = to = 0;
    time = 0;
    hash = {};
    changes.clear();
    types.clear();
    input.reset();
    authors.reset();
    heard.reset();
}

}  // namespace rtsg
