// Chooses the pictures of films that MovieTextures show.
#include <rtsg/renderers/movie.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include <fmt/format.h>

#include <rtsg/core/memory.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "image/movie_files.h"
#include "texture_pixels.h"

namespace rtsg {

namespace {

MovieBytes bytesOf(const Resource& file) {
    return {file.size(),
            [&file](std::uint64_t offset, std::span<std::uint8_t> to) {
                const std::string part = file.readAt(offset, to.size());
                std::memcpy(to.data(), part.data(), part.size());
                return part.size();
            },
            [](std::uint64_t more) { return mayHold(more).has_value(); }};
}

Result<std::unique_ptr<MovieFile>> openFile(const Resource& named, MovieBytes bytes, std::uint64_t maximumPixels) {
    if (!Movie::isMovie(named)) return fail(fmt::format("{} is no film of a format that is read", named.name()));
    const auto files = movieFiles();
    if (!files) return std::unexpected(files.error());
    std::unique_ptr<MovieFile> film;
    if (const std::string error = (*files)->open(std::move(bytes), maximumPixels, film); !error.empty())
        return fail(fmt::format("{}: {}", named.name(), error));
    return film;
}

/// Whether a PNG file says before its picture that it is animated: chunk acTL (PNG, third edition, 11.3.6.1).
bool isAnimatedPng(const Resource& file) {
    constexpr int kMostChunks = 64;  // of colours, sizes and texts
    constexpr std::uint64_t kSignature = 8, kAround = 12;
    std::uint64_t at = kSignature;
    for (int i = 0; i < kMostChunks; ++i) {
        const std::string head = file.readAt(at, 8);
        if (head.size() < 8 || head.ends_with("IDAT")) return false;
        if (head.ends_with("acTL")) return true;
        std::uint32_t length = 0;
        for (int k = 0; k < 4; ++k)
            length = length << 8 | static_cast<unsigned char>(head[static_cast<std::size_t>(k)]);
        at += kAround + length;
    }
    return false;
}

}  // namespace

bool Movie::isMovie(const Resource& file) {
    using namespace std::string_view_literals;
    const std::string head = file.readAt(0, 16);
    const std::string_view all = head;
    if (all.size() < 12) return false;
    return all.substr(4, 4) == "ftyp"sv || all.substr(4, 4) == "moov"sv || all.substr(4, 4) == "mdat"sv ||
           all.starts_with("\x1A\x45\xDF\xA3"sv) || (all.starts_with("RIFF"sv) && all.substr(8, 4) == "AVI "sv) ||
           all.starts_with("OggS"sv) || all.starts_with("\0\0\1\xBA"sv) || all.starts_with("\0\0\1\xB3"sv) ||
           all.starts_with("GIF8"sv) || (all.starts_with("\x89PNG\r\n\x1A\n"sv) && isAnimatedPng(file));
}

Result<Movie> Movie::open(Resource file, std::uint64_t maximumPixels) {
    const auto kept = std::make_shared<const Resource>(std::move(file));
    MovieBytes bytes = bytesOf(*kept);
    bytes.read = [kept, read = std::move(bytes.read)](std::uint64_t offset, std::span<std::uint8_t> to) {
        return read(offset, to);
    };
    auto film = openFile(*kept, std::move(bytes), maximumPixels);
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

Result<double> movieSeconds(const Resource& file) {
    const auto film = openFile(file, bytesOf(file), std::uint64_t{1} << 26);
    if (!film) return std::unexpected(film.error());
    return (*film)->seconds();
}

Result<MovieSound> movieSound(const Resource& file, std::uint64_t maximumSamples, bool* known) {
    if (known) *known = Movie::isMovie(file);
    const auto files = movieFiles();
    if (!files) return std::unexpected(files.error());
    FileSound sound;
    const std::string error = (*files)->readSound(bytesOf(file), maximumSamples, sound);
    if (known) *known = *known || sound.known;
    if (!error.empty()) return fail(fmt::format("{}: {}", file.name(), error));
    return MovieSound{sound.sampleRate, sound.channels, std::move(sound.samples)};
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
