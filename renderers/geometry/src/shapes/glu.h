// GLU's tessellator, whose library is loaded when the first one is made.
#pragma once

#include <GL/glu.h>

#include <stdexcept>

#include <rtsg/core/module.h>

namespace rtsg::delayed {
extern DelayedLibrary glu;
}

namespace rtsg::detail {

/// Null without memory. Throws if the library is missing: the subscriber is then detached, with this reason.
inline GLUtesselator* newTessellator() {
    if (const auto loaded = delayed::glu.load(); !loaded) throw std::runtime_error(loaded.error().text);
    return gluNewTess();
}

}  // namespace rtsg::detail
