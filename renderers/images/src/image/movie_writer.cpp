// Writes films of pictures: the module decides their bytes, this file their place.
#include <rtsg/renderers/movie_writer.h>

#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/output_file.h>

#include "movie_files.h"

namespace rtsg {

struct MovieWriter::Impl {
    explicit Impl(OutputFile opened) : output(std::move(opened)) {}

    bool write(std::uint64_t offset, std::span<const std::uint8_t> bytes) {
        while (!bytes.empty()) {
            const ssize_t done = ::pwrite(output.descriptor(), bytes.data(), bytes.size(), static_cast<off_t>(offset));
            if (done < 0 && errno == EINTR) continue;
            if (done <= 0) {
                reason = done < 0 ? std::strerror(errno) : "nothing more is taken";
                return false;
            }
            offset += static_cast<std::uint64_t>(done);
            bytes = bytes.subspan(static_cast<std::size_t>(done));
        }
        return true;
    }
    Result<> done(const std::string& error) const {
        if (error.empty()) return {};
        return fail(reason.empty() ? error : fmt::format("{}: {}", error, reason), {}, file);
    }

    std::string file, reason;
    int width = 0, height = 0;
    OutputFile output;
    std::unique_ptr<MovieMaker> maker;
};

MovieWriter::MovieWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
MovieWriter::MovieWriter(MovieWriter&&) noexcept = default;
MovieWriter& MovieWriter::operator=(MovieWriter&&) noexcept = default;
MovieWriter::~MovieWriter() = default;

bool MovieWriter::isName(const std::filesystem::path& file) {
    return lowerExtension(file) == ".mp4";
}

Result<MovieWriter> MovieWriter::create(const std::filesystem::path& file, int width, int height,
                                        double picturesPerSecond, Sound sound) {
    if (!(picturesPerSecond > 0) || !std::isfinite(picturesPerSecond))
        return fail("pictures per second must be positive", {}, file.string());
    const auto files = movieFiles();
    if (!files) return std::unexpected(files.error());
    auto output = OutputFile::create(file);
    if (!output) return std::unexpected(output.error());
    auto impl = std::make_unique<Impl>(std::move(*output));
    impl->file = file.string(), impl->width = width, impl->height = height;
    MovieSink sink{[to = impl.get()](std::uint64_t offset, std::span<const std::uint8_t> bytes) {
        return to->write(offset, bytes);
    }};
    if (auto ok = impl->done(
            (*files)->make(std::move(sink), {width, height, picturesPerSecond, sound == Sound::awaited}, impl->maker));
        !ok)
        return std::unexpected(ok.error());
    return MovieWriter(std::move(impl));
}

Result<> MovieWriter::add(const Picture& picture, const ToneMap& toneMap) {
    if (picture.width != impl_->width || picture.height != impl_->height)
        return fail(fmt::format("the pictures of a film have one size, here {} x {} and {} x {}", impl_->width,
                                impl_->height, picture.width, picture.height),
                    {}, impl_->file);
    std::vector<std::uint8_t> bytes = toSrgb8(picture, toneMap);
    for (std::size_t i = 0; i < bytes.size(); i += 4)
        if (const int alpha = bytes[i + 3]; alpha < 255)
            for (std::size_t c = i; c < i + 3; ++c)
                bytes[c] = static_cast<std::uint8_t>((bytes[c] * alpha + 127) / 255);
    return impl_->done(impl_->maker->add(bytes));
}

Result<> MovieWriter::hold(std::uint64_t pictures) {
    for (; pictures > 0; --pictures)
        if (auto ok = impl_->done(impl_->maker->repeat()); !ok) return ok;
    return {};
}

Result<> MovieWriter::addSound(std::span<const float> samples, int sampleRate, int channels) {
    FileSound sound{sampleRate, channels, {samples.begin(), samples.end()}};
    if (auto ok = impl_->done(impl_->maker->sound(sound)); !ok) {
        impl_->maker.reset();
        return ok;
    }
    return {};
}

Result<> MovieWriter::finish() {
    if (!impl_->maker) return fail("its sound could not be written", {}, impl_->file);
    if (auto ok = impl_->done(impl_->maker->finish()); !ok) return ok;
    return impl_->output.commit();
}

}  // namespace rtsg
