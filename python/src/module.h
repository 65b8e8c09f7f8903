// The parts of the extension module, each of which adds its classes and functions.
#pragma once

#include <pybind11/pybind11.h>

namespace rtsg::python {

void addScene(pybind11::module_& module);
void addNodes(pybind11::module_& module);
void addChanges(pybind11::module_& module);
void addOwnNodes(pybind11::module_& module);
void addPictures(pybind11::module_& module);
void addSound(pybind11::module_& module);
void addMirrors(pybind11::module_& module);
void addLogs(pybind11::module_& module);
void addReplayTests(pybind11::module_& module);

}  // namespace rtsg::python
