// Films that are read in the sandbox: a worker for each film that is open.
//
// Threading: any thread; one film on one thread at a time. Precondition: isSandboxed().
#pragma once

#include "movie_files.h"

namespace rtsg {

/// Reads in the sandbox, and makes films here.
const MovieFiles& sandboxedMovieFiles();

}  // namespace rtsg
