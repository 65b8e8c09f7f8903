// Movie: the pictures of a film by the time at which they are shown.
//
// Films are recognised by their first bytes: MP4 and related formats, Matroska and WebM, AVI, Ogg, MPEG-1 and -2,
// animated GIF. FFmpeg's libraries decode them, on the calling thread. Pictures are shown by their own time stamps, so
// films of changing rate are right. A step forward decodes one picture; a step back decodes all since the last key
// frame before it, in MPEG streams and GIF all since the beginning. Threading: one thread at a time. Source: ISO/IEC
// 19775-1 V4.0 18.4.2 (MovieTexture).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/resource.h>
#include <rtsg/renderers/movie_sound.h>
#include <rtsg/renderers/texture.h>

namespace rtsg {

class MovieFile;
class Node;

class Movie {
  public:
    /// The same as rtsg::isMovie().
    static bool isMovie(const Resource& file) { return rtsg::isMovie(file); }
    /// Errors: no film; a format that cannot be decoded; pictures of more than `maximumPixels`; no length.
    static Result<Movie> open(Resource file, std::uint64_t maximumPixels = std::uint64_t{1} << 26);
    Movie(Movie&&) noexcept;
    Movie& operator=(Movie&&) noexcept;
    ~Movie();

    double seconds() const;
    /// The picture shown `seconds` after the film's beginning: the first one before that, the last one after its end.
    /// Nothing if it is the picture that the last call returned.
    Result<std::optional<Texture>> frameAt(double seconds, Texture::Content content = Texture::Content::color);

  private:
    Movie() = default;
    std::unique_ptr<MovieFile> file_;
};

/// The time in its film that a MovieTexture shows, by its clock and speed: 0 to `length`, in seconds. Before its clock
/// has ever run, this is the film's beginning, or its end at a negative speed; later it is where the clock stopped.
double movieTime(const Node& node, double length);

}  // namespace rtsg
