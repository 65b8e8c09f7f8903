// Gives films to workers of the sandbox, and checks what comes out.
#include "sandbox_movies.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <rtsg/core/machine.h>
#include <rtsg/core/sandbox.h>

namespace rtsg {

namespace {

constexpr const char* kBroken = "the library that reads it is broken";

struct FilmJob {
    std::uint64_t size = 0;     // bytes of the file
    std::uint64_t maximum = 0;  // pixels of a picture, or samples
    std::uint32_t isSound = 0;
};
struct BytesQuestion {
    std::uint64_t offset = 0, length = 0;
};
/// What a worker says of a film; a sentence follows.
struct FilmHead {
    double seconds = 0;
    std::uint32_t width = 0, height = 0, channels = 0, isEncoded = 0, hasChanged = 0;
};
struct SoundHead {
    std::int32_t sampleRate = 0, channels = 0;
    std::uint32_t isKnown = 0;
};
struct FilmCommand {
    double time = 0;
    std::uint32_t ends = 0;
};

// ---- in the worker ---------------------------------------------------------------------------------------------

MovieBytes bytesOf(SandboxJob& job, std::uint64_t size) {
    // Memory has the worker's limit.
    return {size, [&job](std::uint64_t offset, std::span<std::uint8_t> to) {
                std::size_t done = 0;
                while (done < to.size()) {
                    const std::string part =
                        job.ask(sandboxText(BytesQuestion{offset + done, std::min(to.size() - done, kMaxSandboxText)}));
                    if (part.empty()) break;
                    const std::size_t count = std::min(part.size(), to.size() - done);
                    std::memcpy(to.data() + done, part.data(), count);
                    done += count;
                }
                return done;
            }};
}

void serveSound(SandboxJob& job, const MovieFiles& files, const FilmJob& wanted) {
    FileSound sound;
    const std::string error = files.readSound(bytesOf(job, wanted.size), wanted.maximum, sound);
    if (error.empty() && !sound.samples.empty()) {
        const std::size_t size = sound.samples.size() * sizeof(float);
        std::memcpy(job.room(size).data(), sound.samples.data(), size);
    }
    job.answer(sandboxText(SoundHead{sound.sampleRate, sound.channels, sound.known ? 1U : 0U}, error));
}

void serveFilm(SandboxJob& job, const MovieFiles& files, const FilmJob& wanted) {
    std::unique_ptr<MovieFile> film;
    std::string error = files.open(bytesOf(job, wanted.size), wanted.maximum, film);
    if (!film) return job.answer(sandboxText(FilmHead{}, error));
    FilmHead head{film->seconds()};
    FilePixels pixels;
    for (;;) {
        const std::string said = job.pause(sandboxText(head, error));
        FilmCommand command;
        std::string_view text = said;
        if (!takeSandboxNumbers(text, command) || command.ends != 0) return job.answer({});
        bool hasChanged = false;
        error = film->frameAt(command.time, hasChanged, pixels);
        head.hasChanged = hasChanged && error.empty() ? 1 : 0;
        if (head.hasChanged == 0) continue;
        head.width = static_cast<std::uint32_t>(pixels.width), head.height = static_cast<std::uint32_t>(pixels.height);
        head.channels = static_cast<std::uint32_t>(pixels.channels), head.isEncoded = pixels.encoded ? 1U : 0U;
        std::memcpy(job.room(pixels.bytes.size()).data(), pixels.bytes.data(), pixels.bytes.size());
    }
}

void serve(SandboxJob& job) {
    FilmJob wanted;
    std::string_view head = job.head();
    takeSandboxNumbers(head, wanted);
    const auto files = movieFilesHere();
    if (!files) return job.answer(sandboxText(FilmHead{}, files.error().text));
    return wanted.isSound != 0 ? serveSound(job, **files, wanted) : serveFilm(job, **files, wanted);
}

constexpr SandboxTask kFilms{"films",
                             [] {
                                 const auto files = movieFilesHere();
                                 return files ? Result<>() : std::unexpected(files.error());
                             },
                             serve};

// ---- in the process that shows the film --------------------------------------------------------------------------

SandboxAnswers answersFrom(const MovieBytes& bytes) {
    return [&bytes](std::string_view question) {
        BytesQuestion asked;
        std::string part;
        if (!takeSandboxNumbers(question, asked) || asked.offset >= bytes.size) return part;
        part.resize(static_cast<std::size_t>(
            std::min({asked.length, std::uint64_t{kMaxSandboxText}, bytes.size - asked.offset})));
        part.resize(bytes.read(asked.offset, {reinterpret_cast<std::uint8_t*>(part.data()), part.size()}));
        return part;
    };
}

class SandboxedFilm final : public MovieFile {
  public:
    SandboxedFilm(MovieBytes bytes, std::uint64_t maximumPixels)
        : bytes_(std::move(bytes)), maximumPixels_(maximumPixels) {}
    SandboxedFilm(const SandboxedFilm&) = delete;
    SandboxedFilm& operator=(const SandboxedFilm&) = delete;
    ~SandboxedFilm() override {
        if (at_.isPaused()) (void)resumeSandboxed(std::move(at_), sandboxText(FilmCommand{0, 1}));
    }

    std::string begin() {
        auto begun =
            runSandboxed(kFilms, sandboxText(FilmJob{bytes_.size, maximumPixels_, 0}), {}, answersFrom(bytes_));
        FilmHead head;
        if (std::string error = take(std::move(begun), head); !error.empty()) return error;
        seconds_ = head.seconds;
        return at_.isPaused() && std::isfinite(seconds_) && seconds_ > 0 ? "" : kBroken;
    }

    double seconds() const override { return seconds_; }

    std::string frameAt(double time, bool& changed, FilePixels& out) override {
        changed = false;
        if (!broken_.empty()) return broken_;
        FilmHead head;
        std::string error =
            take(resumeSandboxed(std::move(at_), sandboxText(FilmCommand{time, 0}), answersFrom(bytes_)), head);
        if (!at_.isPaused()) return broken_ = error.empty() ? kBroken : error;
        if (!error.empty() || head.hasChanged == 0) return error;
        const std::uint64_t pixels = std::uint64_t{head.width} * head.height;
        constexpr std::uint32_t kLargestSide = 1 << 15;
        if (head.width - 1 >= kLargestSide || head.height - 1 >= kLargestSide || pixels > maximumPixels_ ||
            (head.channels != 3 && head.channels != 4) || pixels * head.channels != at_.size())
            return broken_ = kBroken;
        out.width = static_cast<int>(head.width), out.height = static_cast<int>(head.height), out.layers = 1;
        out.channels = static_cast<int>(head.channels), out.encoded = head.isEncoded != 0;
        out.values.clear();
        out.bytes.resize(at_.size());
        if (!at_.read(out.bytes)) return broken_ = kBroken;
        changed = true;
        return {};
    }

  private:
    /// Keeps the worker, and gives what it says; a sentence if that is an error.
    std::string take(Result<SandboxResult> result, FilmHead& head) {
        at_ = {};
        if (!result) return result.error().text;
        at_ = std::move(*result);
        std::string_view text = at_.head();
        return takeSandboxNumbers(text, head) ? std::string(text) : kBroken;
    }

    MovieBytes bytes_;
    std::uint64_t maximumPixels_;
    double seconds_ = 0;
    SandboxResult at_;
    std::string broken_;
};

class SandboxedMovies final : public MovieFiles {
  public:
    std::string make(MovieSink sink, const FilmShape& shape, std::unique_ptr<MovieMaker>& out) const override {
        const auto here = movieFilesHere();
        return here ? (*here)->make(std::move(sink), shape, out) : here.error().text;
    }
    std::string open(MovieBytes bytes, std::uint64_t maximumPixels, std::unique_ptr<MovieFile>& out) const override {
        auto film = std::make_unique<SandboxedFilm>(std::move(bytes), maximumPixels);
        std::string error = film->begin();
        if (error.empty()) out = std::move(film);
        return error;
    }
    std::string readSound(MovieBytes bytes, std::uint64_t maximumSamples, FileSound& out) const override {
        const auto read =
            runSandboxed(kFilms, sandboxText(FilmJob{bytes.size, maximumSamples, 1}), {}, answersFrom(bytes));
        if (!read) return read.error().text;
        SoundHead head;
        std::string_view text = read->head();
        if (!takeSandboxNumbers(text, head)) return kBroken;
        out.known = head.isKnown != 0;
        if (!text.empty()) return std::string(text);
        const std::size_t samples = read->size() / sizeof(float);
        if (head.sampleRate < 1 || head.sampleRate > 1'000'000 || head.channels < 1 || head.channels > 64 ||
            samples > maximumSamples || read->size() % (sizeof(float) * static_cast<std::size_t>(head.channels)) != 0)
            return kBroken;
        if (!mayHold(read->size()))
            return "its sound is longer than the process may hold; --limit memory=N raises this";
        out.sampleRate = head.sampleRate, out.channels = head.channels;
        out.samples.resize(samples);
        if (!read->read({reinterpret_cast<std::uint8_t*>(out.samples.data()), read->size()})) return kBroken;
        std::ranges::replace_if(out.samples, [](float sample) { return !std::isfinite(sample); }, 0.0f);
        return {};
    }
};

}  // namespace

const MovieFiles& sandboxedMovieFiles() {
    static const SandboxedMovies files;
    return files;
}

}  // namespace rtsg
