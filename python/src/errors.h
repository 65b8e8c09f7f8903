// Converts diagnostics to Python exceptions: rtsg.Error, and its subclass for each kind of code.
//
// The classes are Python's (rtsg/_errors.py). Threading: with the interpreter's lock.
#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <utility>

#include <rtsg/core/diagnostic.h>

namespace rtsg::python {

/// Throws the exception for a diagnostic: of the class of that name in _errors.py, or, where none is given, that of its
/// code.
[[noreturn]] void raise(const Diagnostic& diagnostic, const char* kind = nullptr);
[[noreturn]] void raise(DiagnosticCode code, std::string text, const char* kind = nullptr);
/// rtsg.Diagnostic.
pybind11::object toPython(const Diagnostic& diagnostic);
/// Warns of it as rtsg.DiagnosticWarning; throws where the user has made warnings errors.
void warn(const std::string& text);

/// The value, or the exception.
template <class T>
T take(Result<T> result) {
    if (!result) raise(result.error());
    if constexpr (!std::is_void_v<T>) return std::move(*result);
}

}  // namespace rtsg::python
