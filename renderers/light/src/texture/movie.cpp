// Chooses the pictures of films that MovieTextures show.
#include "movie.h"

#include <algorithm>
#include <cmath>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "image/movie_files.h"
#include "texture_pixels.h"

namespace rtsg {

Result<Movie> Movie::open(Resource file, std::uint64_t maximumPixels) {
    auto film = openMovie(std::make_shared<const Resource>(std::move(file)), maximumPixels);
    if (!film) return std::unexpected(film.error());
    Movie movie;
    movie.file_ = std::move(*film);
    return movie;
}

Movie::Movie(Movie&&) noexcept = default;
Movie& Movie::operator=(Movie&&) noexcept = default;
Movie::~Movie() = default;

double Movie::seconds() const {
    return file_->seconds();
}

Result<std::optional<Texture>> Movie::frameAt(double seconds, Texture::Content content) {
    bool changed = false;
    FilePixels pixels;
    if (const std::string error = file_->frameAt(seconds, changed, pixels); !error.empty()) return fail(error);
    if (!changed) return std::nullopt;
    auto texture = textureFromPixels(pixels, content);
    if (!texture) return std::unexpected(texture.error());
    return std::move(*texture);
}

double movieTime(const Node& node, double length) {
    using M = x3d::MovieTexture;
    const double speed = double(node.get(M::speed)), elapsed = node.get(M::elapsedTime).seconds;
    if (!(speed != 0) || !std::isfinite(speed) || !(length > 0)) return 0;
    const double cycle = length / std::abs(speed);
    double time = std::isfinite(elapsed) && elapsed > 0 ? std::fmod(elapsed, cycle) : 0;
    // 18.4.2: a movie that has ended stays at its end, and is not at its beginning again.
    if (!node.get(M::isActive) && elapsed > 0 && time < 1e-9 * elapsed) time = cycle;
    time *= std::abs(speed);
    return std::clamp(speed < 0 ? length - time : time, 0.0, length);
}

}  // namespace rtsg
