// What a film is heard by.
#pragma once

#include "image/movie_files.h"

namespace rtsg {

/// As MovieFiles::readSound().
std::string readFilmSound(MovieBytes bytes, std::uint64_t maximumSamples, FileSound& out);

}  // namespace rtsg
