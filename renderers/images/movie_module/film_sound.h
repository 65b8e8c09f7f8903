// Reads the sound of a film.
#pragma once

#include "image/movie_files.h"

namespace rtsg {

/// Does what MovieFiles::readSound() does.
std::string readFilmSound(MovieBytes bytes, std::uint64_t maximumSamples, FileSound& out);

}  // namespace rtsg
