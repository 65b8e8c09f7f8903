// A ChangeSet as subscribers get it.
#pragma once

#include <memory>
#include <utility>

#include <rtsg/core/change.h>

namespace rtsg::test {

inline std::shared_ptr<const ChangeSet> shared(ChangeSet set) {
    return std::make_shared<const ChangeSet>(std::move(set));
}

}  // namespace rtsg::test
