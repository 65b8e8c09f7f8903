// A change set as a Python object.
//
// Invariant: a subscriber is handed the scene's own set, which is valid during the call; if Python keeps it, it becomes
// a copy. Threading: with the interpreter's lock. A kept set may be read on any thread, except for members that ask the
// scene.
#pragma once

#include <pybind11/pybind11.h>

#include <memory>

#include <rtsg/core/change.h>

#include "scene_handle.h"

namespace rtsg::python {

struct ChangesObject {
    pybind11::object scene;
    const ChangeSet* set = nullptr;
    std::shared_ptr<const ChangeSet> kept;

    int traverse(visitproc visit, void* arg) {
        Py_VISIT(scene.ptr());
        return 0;
    }
    void clear() {}
};

/// Null: None.
pybind11::object toPython(std::shared_ptr<const ChangeSet> set, const pybind11::object& scene);
/// Calls a function with the set; if the callee keeps the set, it gets a copy.
void callWith(const pybind11::function& call, const pybind11::object& scene, const ChangeSet& changes);

}  // namespace rtsg::python
