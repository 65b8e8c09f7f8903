// The length and the sound of films; their pictures are those of Movie.
//
// Films are recognised by their first bytes: MP4 and related formats, Matroska and WebM, AVI, Ogg, MPEG-1 and -2,
// animated GIF and PNG. FFmpeg's libraries decode them, on the calling thread. Threading: any thread.
#pragma once

#include <cstdint>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/resource.h>

namespace rtsg {

/// Whether the content begins like a film; GIF files with a single picture count, too.
bool isMovie(const Resource& file);

/// The length of a film in seconds. Errors: no film; a format that cannot be decoded; no length.
Result<double> movieSeconds(const Resource& file);

/// The sound of a film, from its first picture on and as long as its pictures; for a file without pictures, the whole
/// sound.
struct MovieSound {
    int sampleRate = 0, channels = 0;
    std::vector<float> samples;  // interleaved
};
/// Reads the sound of files that isMovie() knows, and of AAC, AC-3 and Windows Media files, whatever their
/// names. `known` is set if it is one of these. Errors: another kind of file; no sound that can be decoded; more than
/// `maximumSamples` in all channels together.
Result<MovieSound> movieSound(const Resource& file, std::uint64_t maximumSamples, bool* known = nullptr);

}  // namespace rtsg
