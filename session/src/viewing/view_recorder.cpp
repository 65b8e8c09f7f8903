// Writes logs and films of the scene in a window.
#include <rtsg/session/view_recorder.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

namespace rtsg {

namespace {

constexpr double kFilmRate = 30;

std::string said(const std::string& file, std::string_view what) {
    return fmt::format("{}: note: {}", file, what);
}

/// Scales a picture to the film's size, with interpolation.
Picture enlarged(const LivePictureShown& from, int width, int height) {
    Picture to(width, height, Vec4f(0, 0, 0, 1));
    to.space = ColorSpace::display;
    const auto pixel = [&](int x, int y) {
        const std::uint8_t* p = from.pixels.data() + 4 * (static_cast<std::ptrdiff_t>(y) * from.width + x);
        return Vec3f(p[2], p[1], p[0]) / 255.f;
    };
    for (int y = 0; y < height; ++y) {
        const float v = std::max(
            0.f, (static_cast<float>(y) + .5f) * static_cast<float>(from.height) / static_cast<float>(height) - .5f);
        const int y0 = static_cast<int>(v), y1 = std::min(y0 + 1, from.height - 1);
        for (int x = 0; x < width; ++x) {
            const float u = std::max(
                0.f, (static_cast<float>(x) + .5f) * static_cast<float>(from.width) / static_cast<float>(width) - .5f);
            const int x0 = static_cast<int>(u), x1 = std::min(x0 + 1, from.width - 1);
            const float s = u - static_cast<float>(x0), t = v - static_cast<float>(y0);
            const Vec3f above = glm::mix(pixel(x0, y0), pixel(x1, y0), s),
                        below = glm::mix(pixel(x0, y1), pixel(x1, y1), s);
            to.at(x, y) = Vec4f(glm::mix(above, below, t), 1);
        }
    }
    return to;
}

}  // namespace

Result<std::unique_ptr<WindowFilm>> WindowFilm::start(const std::string& file, int width, int height) {
    width = std::max(2, width / 2 * 2), height = std::max(2, height / 2 * 2);
    auto writer = MovieWriter::create(file, width, height, kFilmRate);
    if (!writer) return std::unexpected(writer.error());
    return std::unique_ptr<WindowFilm>(new WindowFilm(std::move(*writer), width, height));
}
WindowFilm::WindowFilm(MovieWriter writer, int width, int height)
    : writer_(std::move(writer)), width_(width), height_(height) {}
WindowFilm::~WindowFilm() {
    (void)finish(seconds_);
}

void WindowFilm::show(std::shared_ptr<const LivePictureShown> picture, double seconds) {
    if (!picture || picture == last_) return;
    last_ = picture;
    seconds_ = seconds;
    // One that was not reached is left out.
    worker_.startInstead([this, picture = std::move(picture), seconds] {
        if (result_) result_ = take(picture, seconds, false);
    });
}

void WindowFilm::end(double seconds) {
    ends_ = true;
    // The last picture is shown to the end.
    worker_.startInstead([this, last = last_, seconds = std::max(seconds, 1 / kFilmRate)] {
        if (result_) result_ = take(last, seconds, true);
        if (result_) result_ = written_ > 0 ? writer_.finish() : fail("the film has no picture");
    });
}

Result<> WindowFilm::finish(double seconds) {
    if (!ends_) end(seconds);
    worker_.finish();
    const Result<> thrown = worker_.failure("the film ended");
    return thrown ? result_ : thrown;
}

/// Writes the picture before, now that its end is known.
Result<> WindowFilm::take(std::shared_ptr<const LivePictureShown> next, double seconds, bool ends) {
    if (before_)
        if (auto ok = write(*before_, static_cast<std::uint64_t>(std::llround(seconds * kFilmRate))); !ok) return ok;
    if (next) before_ = std::move(next);
    return ends && before_ && written_ == 0 ? write(*before_, 1) : Result<>();
}

/// Writes this picture for all frames from the last written one up to this number.
Result<> WindowFilm::write(const LivePictureShown& picture, std::uint64_t until) {
    if (until <= written_) return {};
    if (auto ok = writer_.add(enlarged(picture, width_, height_)); !ok) return ok;
    if (auto ok = until > written_ + 1 ? writer_.hold(until - written_ - 1) : Result<>(); !ok) return ok;
    written_ = until;
    return {};
}

ViewRecorder::~ViewRecorder() {
    (void)finish();
}

void ViewRecorder::toggleLog(Scene& scene) {
    if (log_) {
        const Result<> done = std::exchange(log_, nullptr)->stop();
        done ? context_.note(said(logFile_, "log written")) : static_cast<void>(context_.report(done.error()));
        return;
    }
    logFile_ = freeName(".rlog");
    auto log = LogRecorder::start(scene, logFile_);
    if (!log) return static_cast<void>(context_.report(log.error()));
    log_ = std::move(*log);
    context_.note(said(logFile_, "log begun"));
}

void ViewRecorder::toggleFilm(const SceneWindow& window, double seconds) {
    if (film_) {
        film_->end(seconds - begun_);
        ended_.push_back({filmFile_, std::move(film_)});
        context_.note(said(filmFile_, "film ended, and is being written"));
        return;
    }
    filmFile_ = freeName(".mp4");
    const auto [width, height] = window.size();
    auto film = WindowFilm::start(filmFile_, width, height);
    if (!film) return static_cast<void>(context_.report(film.error()));
    film_ = std::move(*film);
    begun_ = seconds;
    context_.note(said(filmFile_, "film begun"));
}

void ViewRecorder::show(const SceneWindow& window, double seconds) {
    now_ = seconds;
    for (Ended& one : ended_)
        if (one.film->isWritten()) {
            const Result<> done = std::exchange(one.film, nullptr)->finish(now_);
            done ? context_.note(said(one.file, "film written")) : static_cast<void>(context_.report(done.error()));
        }
    std::erase_if(ended_, [](const Ended& one) { return !one.film; });
    if (film_) film_->show(window.shown(), seconds - begun_);
}

/// Films get their files at the end.
std::string ViewRecorder::freeName(std::string_view extension) const {
    for (int number = 1;; ++number) {
        std::string name = fmt::format("rtsg-{}{}", number, extension);
        std::error_code error;
        const bool isPromised = std::ranges::any_of(ended_, [&](const Ended& one) { return one.file == name; });
        if (!isPromised && !std::filesystem::exists(name, error)) return name;
    }
}

std::string ViewRecorder::status() const {
    std::string text = log_ ? "log " + logFile_ : std::string();
    if (film_) text += (text.empty() ? "film " : ", film ") + filmFile_;
    return text;
}

Result<> ViewRecorder::finish() {
    Result<> result;
    if (log_) result = std::exchange(log_, nullptr)->stop();
    for (Ended& one : ended_)
        if (const Result<> done = one.film->finish(now_); result && !done) result = done;
    ended_.clear();
    if (film_)
        if (const Result<> done = std::exchange(film_, nullptr)->finish(now_ - begun_); result && !done) result = done;
    return result;
}

}  // namespace rtsg
