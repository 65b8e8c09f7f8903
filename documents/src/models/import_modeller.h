// Files of other modellers (Collada and what else libassimp reads well), as X3D.
//
// Invariant: libassimp reads in a process of its own, bounded in memory and time, so that a file that breaks it is an
// error and no more. Threading: pure functions. Source: COLLADA 1.4.1 (Khronos), and libassimp 5.2.
#pragma once

#include "import/import.h"

namespace rtsg::detail {

/// Takes Collada, FBX, 3DS and OFF. Gives a whole document; false if nothing was usable.
bool importModeller(const ImportInput& input, DocumentHandler& handler, Diagnostics& diagnostics);

}  // namespace rtsg::detail
