// The node types of a scene that Python defines.
//
// Threading: with the interpreter's lock.
#pragma once

#include <pybind11/pybind11.h>

namespace rtsg::python {

class SceneHandle;

/// Belongs to a node type of a scene, which calls it as long as it lives.
struct OwnBehaviour {
    SceneHandle* handle = nullptr;
    pybind11::function onTime, onEvent;  // null: there is none
    bool rests = false;                  // after one of them raised
};

}  // namespace rtsg::python
