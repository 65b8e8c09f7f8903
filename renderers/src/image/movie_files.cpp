// Finds and loads the module that reads films.
#include "movie_files.h"

#include <dlfcn.h>

#include <fmt/format.h>

namespace rtsg {

#ifdef RTSG_NO_MOVIES

Result<const MovieFiles*> movieFiles() {
    return fail("films are not shown: this build leaves them out (RTSG_MOVIES=OFF)");
}

#else

namespace {

#define RTSG_TEXT_OF(name) #name
#define RTSG_TEXT(name) RTSG_TEXT_OF(name)

Result<const MovieFiles*> loadMovieFiles() {
    // By its name alone: the program's run path and LD_LIBRARY_PATH say where. It stays until the process ends.
    void* module = ::dlopen("librtsg_movies.so", RTLD_NOW | RTLD_LOCAL);
    if (!module) return fail(fmt::format("films need the module librtsg_movies.so: {}", ::dlerror()));
    void* symbol = ::dlsym(module, RTSG_TEXT(RTSG_MOVIE_FILES_SYMBOL));
    if (!symbol) return fail("the module librtsg_movies.so belongs to another version of this program");
    return reinterpret_cast<const MovieFiles* (*)()>(symbol)();
}

}  // namespace

Result<const MovieFiles*> movieFiles() {
    static const Result<const MovieFiles*> files = loadMovieFiles();
    return files;
}

#endif

}  // namespace rtsg
