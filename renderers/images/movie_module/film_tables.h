// The tables of MP4 and QuickTime files: whether they name more samples than the file can hold.
//
// FFmpeg makes an entry of some 24 bytes for each sample that a table counts, and a count may stand alone, without a
// byte for each. Threading: pure. Source: ISO/IEC 14496-12 (4.2, 8.7.3, 8.8.8).
#pragma once

#include <string>

#include "image/movie_files.h"

namespace rtsg {

/// A sentence says why the film is not read; empty: the tables are within the file, or it is of another kind.
std::string whyTablesAreTooLong(const MovieBytes& bytes);

}  // namespace rtsg
