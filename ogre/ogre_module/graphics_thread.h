// GraphicsThread: the thread that OGRE and its graphics context belong to. There is one in a process, as OGRE is.
//
// Invariant: work is done one piece after the other, in the order of coming. Threading: any.
#pragma once

#include <functional>

namespace rtsg {

/// Runs `work` on the graphics thread and waits; if that is the calling thread, runs it at once. Exceptions of `work`
/// are thrown from here.
void onGraphicsThread(const std::function<void()>& work);

}  // namespace rtsg
