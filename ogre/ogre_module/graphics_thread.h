// GraphicsThread: the thread that OGRE and its graphics context belong to. There is one in a process, as OGRE is.
//
// Invariant: work is done one piece after the other, in the order of coming. Threading: any.
#pragma once

#include <functional>

namespace rtsg {

/// Does it there, and waits; at once, if it is that thread that asks. What it throws comes out of here.
void onGraphicsThread(const std::function<void()>& work);

}  // namespace rtsg
