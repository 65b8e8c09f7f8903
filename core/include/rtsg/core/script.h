// How Script nodes are run: limits, output, and what files they may come from.
//
// After runScripts() a scene runs the ECMAScript of its Script nodes, in an engine of its own that comes into being
// with the first of them. What a script does is changes of the scene like any others, made inside newFrame; what it
// makes is destroyed once neither scene nor script refers to it. Chance, clock, zone and locale come from the scene
// (Date follows it, in UTC and en-US), but variables of a script are not part of its state: a replica gets the results
// and runs no script. Threading: the scene's thread; one JavaScript context a thread. Source: ISO/IEC 19775-1 V4.0
// clause 29; ISO/IEC 19777-1 V3.3 (ECMAScript); direct outputs act when the function ends.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string_view>

namespace rtsg {

class Resources;

struct ScriptOptions {
    bool enabled = true;
    /// Seconds of its thread's CPU time that one call of a script's function may take, so that a busy machine stops
    /// nobody; then it is stopped, reported and never called again. All calls of a frame together may take five times
    /// as much, or once as much if those of the frame before needed it all: whose turn comes then is not called again
    /// either.
    double timeLimit = 2;
    /// Bytes that all scripts of one thread may hold, in objects and in the contents of arrays and strings, and by
    /// which one call may let the process grow. Read when the first script of the thread runs.
    std::size_t heapLimit = std::size_t{256} << 20;
    /// What the urls of scripts may open; null: what the first loaded document's urls may. A scene without either opens
    /// nothing.
    std::shared_ptr<const Resources> resources;
    /// Gets what scripts print, as it comes, also in shutdown() when the scene goes; standard output if empty.
    std::function<void(std::string_view)> print;
};

}  // namespace rtsg
