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
    module.def("_living", [] { return SceneHandle::all().size(); }, "How many scenes there are, closed ones included.");
    py::module_::import("atexit").attr("register")(py::cpp_function(&end));
    py::module_::import("os").attr("register_at_fork")(py::arg("after_in_child") = py::cpp_function(&afterFork));
}
