// Raises and warns by the classes of rtsg/_errors.py.
#include "errors.h"

namespace py = pybind11;

namespace rtsg::python {

namespace {

py::object classOf(const char* name) {
    return py::module_::import("rtsg._errors").attr(name);
}

const char* kindOf(std::string_view code) {
    return code == "wrong-thread" ? "WrongThread" : "Error";
}

const char* severityName(Severity severity) {
    return severity == Severity::note ? "note" : severity == Severity::warning ? "warning" : "error";
}

}  // namespace

void raise(const Diagnostic& diagnostic, const char* kind) {
    const py::object type = classOf(kind ? kind : kindOf(diagnostic.code.text()));
    const py::object error = type(diagnostic.text, diagnostic.file, diagnostic.where.line, diagnostic.where.column,
                                  std::string(diagnostic.code.text()));
    PyErr_SetObject(type.ptr(), error.ptr());
    throw py::error_already_set();
}

void raise(DiagnosticCode code, std::string text, const char* kind) {
    Diagnostic diagnostic;
    diagnostic.text = std::move(text);
    diagnostic.code = code;
    raise(diagnostic, kind);
}

py::object toPython(const Diagnostic& diagnostic) {
    return classOf("Diagnostic")(severityName(diagnostic.severity), diagnostic.text, diagnostic.file,
                                 diagnostic.where.line, diagnostic.where.column, std::string(diagnostic.code.text()));
}

void warn(const std::string& text) {
    if (PyErr_WarnEx(classOf("DiagnosticWarning").ptr(), text.c_str(), 1) < 0) throw py::error_already_set();
}

}  // namespace rtsg::python
