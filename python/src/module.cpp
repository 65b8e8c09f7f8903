// The extension module rtsg._rtsg: all its parts, and the handlers for the interpreter's end and for forks.
#include "module.h"

#include "scene_handle.h"
#include "unlocked.h"

namespace py = pybind11;

namespace rtsg::python {

namespace {

/// Scenes that live are ended in order, as far as they are of this thread: their Scripts are told, logs closed.
void end() {
    endWork();
    for (const auto& handle : SceneHandle::all()) {
        if (!handle->isHere()) continue;
        try {
            handle->close();
        } catch (py::error_already_set& error) {  // a warning that is an error, say
            error.discard_as_unraisable("rtsg");
            handle->end();
        }
    }
}

void afterFork() {
    for (const auto& handle : SceneHandle::all()) handle->abandon();
}

/// Of each class: an object whose __init__ was never called holds nothing, and is refused; pybind11 would read memory
/// that nobody has written. And no object is pickled, at which pybind11's own classes end the process.
void closeClasses(const py::module_& module) {
    const py::cpp_function refuse([](const py::object& self, const py::args&) -> py::object {
        throw py::type_error(py::cast<std::string>(
            py::str("cannot pickle '{}' object").format(py::type::of(self).attr("__qualname__"))));
    });
    const auto method = py::reinterpret_steal<py::object>(PyInstanceMethod_New(refuse.ptr()));
    for (const auto& [own, item] : py::cast<py::dict>(module.attr("__dict__"))) {
        if (!PyType_Check(item.ptr())) continue;
        auto* const about = py::detail::get_type_info(reinterpret_cast<PyTypeObject*>(item.ptr()));
        if (!about) continue;
        about->operator_new = [](std::size_t) -> void* {
            throw py::type_error("__init__() of this object was not called");
        };
        for (const char* const name : {"__reduce__", "__reduce_ex__"}) py::setattr(item, name, method);
    }
}

}  // namespace

}  // namespace rtsg::python

PYBIND11_MODULE(_rtsg, module) {
    using namespace rtsg::python;
    module.doc() = "X3D scenes with ray-traced pictures, room sound, mirrors and logs; see the package rtsg.";
    module.attr("__version__") = RTSG_VERSION;
    addScene(module);
    addNodes(module);
    addChanges(module);
    addOwnNodes(module);
    addPictures(module);
    addSound(module);
    addMirrors(module);
    addLogs(module);
    addReplayTests(module);
    closeClasses(module);
    module.def("_living", [] { return SceneHandle::all().size(); }, "How many scenes there are, closed ones included.");
    py::module_::import("atexit").attr("register")(py::cpp_function(&end));
    py::module_::import("os").attr("register_at_fork")(py::arg("after_in_child") = py::cpp_function(&afterFork));
}
