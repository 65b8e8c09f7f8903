// makeFilm: encodes pictures as a film, and writes its bytes through a given function. Threading: one thread a film.
#pragma once

#include <memory>
#include <string>

#include "image/movie_files.h"

namespace rtsg {

/// Does what MovieFiles::make() does.
std::string makeFilm(MovieSink sink, const FilmShape& shape, std::unique_ptr<MovieMaker>& out);

}  // namespace rtsg
