// Joins stretches of sound that several jobs made (replay --frames with --listen), to the sample.
//
// A stretch has the number of the picture with whose time it begins, and ends with the time of a picture or of the log.
// Threading: none.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/session/output_options.h>
#include <rtsg/session/provenance.h>

namespace rtsg {

struct JoinedSound {
    SoundBuffer sound;      // not yet scaled to the range of a file
    Provenance provenance;  // of the first stretch, whose file is `first`
    std::string first;
    /// First and last numbers of pictures of whose time there is no sound; then `sound` is not whole.
    std::vector<std::pair<std::uint64_t, std::uint64_t>> missing;
};

/// `pattern`: a name with a place for numbers. Errors: a stretch that cannot be read, of another format than the first,
/// that ends between pictures, or within which another one begins; a mixture.
Result<JoinedSound> joinSound(const std::string& pattern, const PictureRange& range, double picturesPerSecond);

}  // namespace rtsg
