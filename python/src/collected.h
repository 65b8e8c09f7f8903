// Classes that Python's garbage collector looks into: those that hold Python's objects.
//
// A class T has `int traverse(visitproc, void*)`, which visits each object that it holds exactly once, and `clear()`,
// which lets go of those that may close a circle. Threading: with the interpreter's lock.
#pragma once

#include <pybind11/pybind11.h>

namespace rtsg::python {

namespace detail {
/// Null until the object has been made.
template <class T>
T* insideOf(PyObject* self) {
    return static_cast<T*>(reinterpret_cast<pybind11::detail::instance*>(self)->get_value_and_holder().value_ptr());
}
}  // namespace detail

template <class T>
pybind11::custom_type_setup collected() {
    return pybind11::custom_type_setup([](PyHeapTypeObject* heap) {
        PyTypeObject& type = heap->ht_type;
        type.tp_flags |= Py_TPFLAGS_HAVE_GC;
        type.tp_traverse = [](PyObject* self, visitproc visit, void* arg) -> int {
#if PY_VERSION_HEX >= 0x03090000
            Py_VISIT(Py_TYPE(self));
#endif
            T* const inside = detail::insideOf<T>(self);
            return inside ? inside->traverse(visit, arg) : 0;
        };
        type.tp_clear = [](PyObject* self) -> int {
            if (T* const inside = detail::insideOf<T>(self)) inside->clear();
            return 0;
        };
    });
}

}  // namespace rtsg::python
