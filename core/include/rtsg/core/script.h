// How Script nodes are run: limits, output, and the files that they may come from.
//
// After runScripts() a scene runs the ECMAScript of its Script nodes, in an engine of its own that starts with the
// first of them. The effects of a script are changes of the scene like any others, made inside newFrame. Nodes that it
// makes are destroyed once neither scene nor script refers to them. Random numbers, clock, time zone and locale come
// from the scene (Date follows its clock, in UTC and en-US). Variables of a script are not part of the scene's state: a
// replica gets the results and runs no script. Threading: the scene's thread; one JavaScript context for each thread.
// Source: ISO/IEC 19775-1 V4.0 clause 29; ISO/IEC 19777-1 V3.3 (ECMAScript); direct outputs act when the function ends.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string_view>

namespace rtsg {

class Resources;

struct ScriptOptions {
    bool enabled = true;
    /// CPU seconds of the thread that one call of a script's function may take; CPU time, so that a busy machine stops
    /// no script. After that the call is stopped and reported, and the function is never called again. All calls of a
    /// frame together may take five times as much, or once as much if the frame before used it all; a function whose
    /// turn comes after that is not called again either.
    double timeLimit = 2;
    /// Bytes that all scripts of one thread may hold, in objects and in the contents of arrays and strings; one call
    /// may let the process grow by as much. It is read when the first script of the thread runs.
    std::size_t heapLimit = std::size_t{256} << 20;
    /// What the urls of scripts may open; null: what those of the first loaded document may. A scene with neither opens
    /// nothing.
    std::shared_ptr<const Resources> resources;
    /// Receives what scripts print, as it comes, also during shutdown() when the scene ends; standard output if empty.
    std::function<void(std::string_view)> print;
};

}  // namespace rtsg
