// Opens films, and reads their lengths and their sound.
#include <rtsg/renderers/movie_sound.h>

#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/machine.h>

#include "movie_files.h"

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

/// Whether a PNG file says before its picture that it is animated: chunk acTL (PNG, third edition, 11.3.6.1).
bool isAnimatedPng(const Resource& file) {
    constexpr int kMaxChunks = 64;  // of colours, sizes and texts
    constexpr std::uint64_t kSignature = 8, kAround = 12;
    std::uint64_t at = kSignature;
    for (int i = 0; i < kMaxChunks; ++i) {
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

bool isMovie(const Resource& file) {
    using namespace std::string_view_literals;
    const std::string head = file.readAt(0, 16);
    const std::string_view all = head;
    if (all.size() < 12) return false;
    return all.substr(4, 4) == "ftyp"sv || all.substr(4, 4) == "moov"sv || all.substr(4, 4) == "mdat"sv ||
           all.starts_with("\x1A\x45\xDF\xA3"sv) || (all.starts_with("RIFF"sv) && all.substr(8, 4) == "AVI "sv) ||
           all.starts_with("OggS"sv) || all.starts_with("\0\0\1\xBA"sv) || all.starts_with("\0\0\1\xB3"sv) ||
           all.starts_with("GIF8"sv) || (all.starts_with("\x89PNG\r\n\x1A\n"sv) && isAnimatedPng(file));
}

Result<std::unique_ptr<MovieFile>> openMovie(const std::shared_ptr<const Resource>& file, std::uint64_t maximumPixels) {
    if (!isMovie(*file)) return fail(fmt::format("{} is no film of a format that is read", file->name()));
    const auto files = movieFiles();
    if (!files) return std::unexpected(files.error());
    MovieBytes bytes = bytesOf(*file);
    bytes.read = [file, read = std::move(bytes.read)](std::uint64_t offset, std::span<std::uint8_t> to) {
        return read(offset, to);
    };
    std::unique_ptr<MovieFile> film;
    if (const std::string error = (*files)->open(std::move(bytes), maximumPixels, film); !error.empty())
        return fail(fmt::format("{}: {}", file->name(), error));
    return film;
}

Result<double> movieSeconds(const Resource& file) {
    const std::shared_ptr<const Resource> borrowed(std::shared_ptr<const Resource>(), &file);
    const auto film = openMovie(borrowed, std::uint64_t{1} << 26);
    if (!film) return std::unexpected(film.error());
    return (*film)->seconds();
}

Result<MovieSound> movieSound(const Resource& file, std::uint64_t maximumSamples, bool* known) {
    if (known) *known = isMovie(file);
    const auto files = movieFiles();
    if (!files) return std::unexpected(files.error());
    FileSound sound;
    const std::string error = (*files)->readSound(bytesOf(file), maximumSamples, sound);
    if (known) *known = *known || sound.known;
    if (!error.empty()) return fail(fmt::format("{}: {}", file.name(), error));
    return MovieSound{sound.sampleRate, sound.channels, std::move(sound.samples)};
}

}  // namespace rtsg
