// Finds and loads the module that reads films.
#include "movie_files.h"

#include <rtsg/core/module.h>
#include <rtsg/core/sandbox.h>

#include "sandbox_movies.h"

namespace rtsg {

#ifdef RTSG_NO_MOVIES

Result<const MovieFiles*> movieFilesHere() {
    return fail("films are not shown: this build leaves them out (RTSG_MOVIES=OFF)");
}

#else

namespace {

#define RTSG_TEXT_OF(name) #name
#define RTSG_TEXT(name) RTSG_TEXT_OF(name)

Result<const MovieFiles*> loadMovieFiles() {
    const auto symbol = loadModule("rtsg_movies", RTSG_TEXT(RTSG_MOVIE_FILES_SYMBOL), "films need");
    if (!symbol) return std::unexpected(symbol.error());
    return reinterpret_cast<const MovieFiles* (*)()>(*symbol)();
}

}  // namespace

Result<const MovieFiles*> movieFilesHere() {
    static const Result<const MovieFiles*> files = loadMovieFiles();
    return files;
}

#endif

Result<const MovieFiles*> movieFiles() {
    return isSandboxed() ? Result<const MovieFiles*>(&sandboxedMovieFiles()) : movieFilesHere();
}

}  // namespace rtsg
