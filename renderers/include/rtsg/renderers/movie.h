// Movie: the pictures of a film, each when it is shown.
//
// Films are known by their first bytes: MP4 and its kin, Matroska and WebM, AVI, Ogg, MPEG-1 and -2, animated GIF; what
// is packed in them is decoded by FFmpeg's libraries, on the calling thread. Pictures are shown from their own times
// on, so films of changing rate are right. Going on costs one picture's decoding; going back costs those since the last
// picture that needs none before it, in MPEG streams and GIF those since the beginning.
// Threading: one thread at a time. Source: ISO/IEC 19775-1 V4.0 18.4.2 (MovieTexture).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/resource.h>
#include <rtsg/renderers/texture.h>

namespace rtsg {

class MovieFile;
class Node;

class Movie {
  public:
    /// Whether the content begins as a film does; GIF files with one picture only do, too.
    static bool isMovie(const Resource& file);
    /// Errors: no film, none that can be decoded, pictures of more than `maximumPixels`, no length.
    static Result<Movie> open(Resource file, std::uint64_t maximumPixels = std::uint64_t{1} << 26);
    Movie(Movie&&) noexcept;
    Movie& operator=(Movie&&) noexcept;
    ~Movie();

    double seconds() const;
    /// The picture that is shown `seconds` after the film's beginning: the first one before that, the last one after
    /// its end. Nothing if it is the one that the last call gave.
    Result<std::optional<Texture>> frameAt(double seconds, Texture::Content content = Texture::Content::color);

  private:
    Movie() = default;
    std::unique_ptr<MovieFile> file_;
};

/// How long a film plays. Errors: as Movie::open().
Result<double> movieSeconds(const Resource& file);

/// The sound of a film, from its first picture on and as long as its pictures; of a file without pictures, the whole
/// sound.
struct MovieSound {
    int sampleRate = 0, channels = 0;
    std::vector<float> samples;  // interleaved
};
/// Of files that Movie::isMovie() knows, and of AAC, AC-3 and Windows Media by themselves, whatever their names.
/// `known`: whether it is any of these. Errors: no such file; no sound that can be decoded, more than
/// `maximumSamples`, all channels counted.
Result<MovieSound> movieSound(const Resource& file, std::uint64_t maximumSamples, bool* known = nullptr);

/// The time of its film that a MovieTexture shows, by its clock and speed: 0 to `length`, in seconds. Before its clock
/// has ever run, this is the film's beginning, or its end at a negative speed; later it is where the clock stopped.
double movieTime(const Node& node, double length);

}  // namespace rtsg
