// makeFilm: pictures into a film, through the bytes that it is given a place for. Threading: one thread a film.
#pragma once

#include <memory>
#include <string>

#include "image/movie_files.h"

namespace rtsg {

/// Does what MovieFiles::make() does.
std::string makeFilm(MovieSink sink, const FilmShape& shape, std::unique_ptr<MovieMaker>& out);

}  // namespace rtsg
