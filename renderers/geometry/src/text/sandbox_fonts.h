// Fonts of strangers by workers of the sandbox, fonts of the system by this process: the interface of fonts.h for both.
//
// A character that a stranger's font lacks is drawn by one of the system's. Threading: any thread.
#pragma once

#include "fonts.h"

namespace rtsg {

const Fonts& sandboxedFonts();

/// The module of this process, whether there is a sandbox or not.
Result<const Fonts*> fontsHere();

}  // namespace rtsg
