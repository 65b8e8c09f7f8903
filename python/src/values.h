// Converts field values to Python and back.
//
// MF fields become read-only NumPy arrays over the scene's own memory, which they keep alive. Vectors, colours,
// rotations and matrices become small arrays with a copy, MFNode and MFString become tuples. Threading: with the
// interpreter's lock.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <rtsg/core/node_type.h>
#include <rtsg/core/value.h>

#include "scene_handle.h"

namespace rtsg::python {

/// A node of a scene, as a number.
struct NodeObject {
    pybind11::object scene;
    SceneHandle* handle = nullptr;
    NodeId id;

    /// Raises Closed, WrongThread; NoSuchName where the node is gone.
    const Node& node() const;
    int traverse(visitproc visit, void* arg) {
        Py_VISIT(scene.ptr());
        return 0;
    }
    void clear() {}
};

pybind11::object nodeOrNone(const pybind11::object& scene, NodeId id);
/// `scene`: the Scene object that nodes in the value are of.
pybind11::object toPython(const Value& value, const pybind11::object& scene);
/// Raises TypeError and ValueError for unsuitable objects; `what` names the field in their texts.
Value fromPython(const FieldDef& field, const pybind11::handle& object, const SceneHandle& handle,
                 std::string_view what);
/// The numbers of an SF or MF type that is made of them: `count` values, one after the other, of `components` each.
struct Numbers {
    pybind11::array array;  // C-contiguous, of the type's own numbers
    std::size_t count = 0;
};
Numbers numbersFrom(FieldType type, const pybind11::handle& object, std::string_view what);
/// Raises TypeError where it is no str.
std::string textFrom(const pybind11::handle& object, std::string_view what);
/// The kind of numbers that values of this type have; none: it has none.
std::optional<pybind11::dtype> numberType(FieldType type);
/// The dimensions of one value: (), (3,), (4, 4).
std::vector<pybind11::ssize_t> dimensions(FieldType type);

}  // namespace rtsg::python
