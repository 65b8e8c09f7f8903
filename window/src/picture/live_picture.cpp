// Pictures the newest state on a thread of its own: coarsely while it changes, then whole, then better.
#include <rtsg/window/live_picture.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

#include <fmt/format.h>

namespace rtsg {

namespace {

using Clock = std::chrono::steady_clock;

constexpr double kCoarsest = 0.25;    // of the width, and of the height
constexpr double kOfBudget = 0.9;     // the rest is for enlarging and showing
constexpr double kNewTimes = 0.3;     // the weight of the last picture in the mean
constexpr int kWidthStep = 16;        // widths change in steps, or pictures would swim
constexpr double kFirstGuess = 2e-7;  // seconds a pixel

double secondsSince(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

std::vector<std::uint8_t> windowPixels(const Picture& picture, const ToneMap& toneMap) {
    std::vector<std::uint8_t> pixels = toSrgb8(picture, toneMap);
    for (std::size_t i = 0; i + 3 < pixels.size(); i += 4) {
        std::swap(pixels[i], pixels[i + 2]);
        pixels[i + 3] = 255;
    }
    return pixels;
}

/// The mean of pictures of one size.
class Accumulated {
  public:
    void clear() { samples_ = 0; }
    int samples() const { return samples_; }
    void add(const Picture& picture, int samples) {
        if (samples_ == 0) {
            mean_ = picture;
        } else {
            const float weight = static_cast<float>(samples) / static_cast<float>(samples_ + samples);
            for (std::size_t i = 0; i < mean_.pixels.size(); ++i)
                mean_.pixels[i] += weight * (picture.pixels[i] - mean_.pixels[i]);
        }
        samples_ += samples;
    }
    const Picture& mean() const { return mean_; }

  private:
    Picture mean_;
    int samples_ = 0;
};

}  // namespace

struct LivePicture::Impl {
    /// What is to be pictured.
    struct Subject {
        std::shared_ptr<const WorldState> state;
        std::shared_ptr<const LightState> light;
        std::optional<Camera> eye;
        int width = 0, height = 0;
    };

    Impl(SharedWorld& w, LivePictureOptions o) : world(w), options(std::move(o)), tracer(world, options.resources) {
        subject.width = options.settings.width, subject.height = options.settings.height;
        (void)world.rays();
        number = world.add(tracer);
    }
    ~Impl() {
        {
            const std::scoped_lock lock(mutex);
            stop = true;
            ++changes;
        }
        news.notify_all();
        if (thread.joinable()) thread.join();
        world.remove(tracer);
    }

    SharedWorld& world;
    const LivePictureOptions options;
    LightTracer tracer;
    std::uint64_t number = 0;               // of the tracer's tables
    std::atomic<std::uint64_t> changes{0};  // of what is seen

    mutable std::mutex mutex;  // guards what follows
    std::condition_variable news;
    Subject subject;
    std::shared_ptr<const LivePictureShown> shown;
    LivePictureStatistics statistics;
    std::string failure;
    bool stop = false, done = false;

    // The thread's own.
    std::uint64_t pictured = 0;  // changes that the newest picture shows
    Accumulated better;
    bool isWhole = false;
    double secondsAPixel = kFirstGuess;
    std::thread thread;

    // ---- with `mutex` held -----------------------------------------------------------------------------------
    /// Whether the picture of `next` differs. A frame in which nothing that is seen has changed shares these.
    bool differs(const Subject& next) const {
        const Subject& now = subject;
        const auto eyeOf = [](const Subject& s) { return s.eye ? std::optional(s.eye->position) : std::nullopt; };
        return !now.state || now.state->rays != next.state->rays || now.light != next.light ||
               now.width != next.width || now.height != next.height || eyeOf(now) != eyeOf(next) ||
               (now.eye && next.eye && (now.eye->forward != next.eye->forward || now.eye->up != next.eye->up));
    }
    void change() {
        ++changes;
        done = false;
        news.notify_all();
    }

    // ---- the thread ------------------------------------------------------------------------------------------
    Camera lastCamera;  // of the picture that is being made
    Result<Camera> cameraOf(const Subject& what) const {
        const double aspect = static_cast<double>(what.width) / what.height;
        auto bound = LightTracer::camera(*what.light, *what.state->rays, aspect);
        if (!what.eye || !bound) return bound;
        Camera eye = what.eye->shaped(aspect);
        eye.layer = bound->layer;  // it looks at what the bound viewpoint would
        return eye;
    }

    /// Null: something has changed meanwhile. `isMoving`: it is made to its end all the same.
    Result<std::optional<Picture>> picture(const Subject& what, int width, int height, int samples, std::uint64_t of,
                                           bool isMoving) {
        auto camera = cameraOf(what);
        if (!camera) return std::unexpected(camera.error());
        std::vector<LayerSight> sights;
        if (what.state->sights)
            sights = LightTracer::sights(
                LightTracer::layers(*what.light, *what.state->rays, *camera, what.width, what.height), what.width,
                what.height);
        world.lookFrom(EyePlace(camera->position, camera->up), std::move(sights));
        RenderSettings settings = options.settings;
        settings.width = width, settings.height = height;
        settings.samplesPerPixel = samples;
        settings.seed = options.settings.seed + static_cast<std::uint64_t>(better.samples());
        settings.progress = [&](double) { return isMoving || changes == of; };
        RenderStats stats;
        lastCamera = *camera;
        auto made = LightTracer::render(*what.light, *what.state->rays, *camera, settings, &stats);
        if (!made) return std::unexpected(made.error());
        if (stats.cancelled) return std::optional<Picture>();
        return std::optional(std::move(*made));
    }

    void publish(const Picture& picture, const Subject& what, int samples, Clock::time_point start,
                 bool isMoving = false) {
        auto next = std::make_shared<LivePictureShown>();
        next->width = picture.width, next->height = picture.height;
        next->pixels = windowPixels(picture, options.toneMap);
        next->sequence = what.state->sequence;
        next->samples = samples;
        next->whole = isWhole;
        next->isMoving = isMoving;
        next->seconds = secondsSince(start);
        next->camera = lastCamera;
        {
            const std::scoped_lock lock(mutex);
            shown = std::move(next);
            ++(isWhole ? statistics.whole : statistics.moving);
            statistics.secondsAPixel = secondsAPixel;
        }
        if (options.wake) options.wake();
    }

    /// As many pixels as the budget allows; the whole picture if these are all.
    Result<> coarse(const Subject& what, std::uint64_t of) {
        const Clock::time_point start = Clock::now();
        const double all = static_cast<double>(what.width) * what.height;
        const double scale = std::clamp(std::sqrt(kOfBudget * options.budget / (secondsAPixel * all)), kCoarsest, 1.);
        int width = what.width, height = what.height;
        if (scale < 1) {
            width = std::max(1, static_cast<int>(std::lround(scale * what.width / kWidthStep)) * kWidthStep);
            width = std::min(width, what.width);
            height = std::max(1, static_cast<int>(std::lround(static_cast<double>(width) * what.height / what.width)));
        }
        better.clear();
        auto made = picture(what, width, height, 1, of, true);
        if (!made) return std::unexpected(made.error());
        pictured = of;
        isWhole = width == what.width;
        publish(**made, what, 1, start, true);
        const double spent = secondsSince(start) / (static_cast<double>(width) * height);
        secondsAPixel += kNewTimes * (spent - secondsAPixel);
        return {};
    }

    /// The first whole picture, or one with more samples.
    Result<> refine(const Subject& what, std::uint64_t of) {
        const Clock::time_point start = Clock::now();
        const int samples = isWhole ? std::max(1, options.settings.samplesPerPixel) : 1;
        auto made = picture(what, what.width, what.height, samples, of, false);
        if (!made) return std::unexpected(made.error());
        if (!*made) {
            const std::scoped_lock lock(mutex);
            ++statistics.cancelled;
            return {};
        }
        if (!isWhole) {
            isWhole = true;
            if (options.settings.integrator == Integrator::path) better.add(**made, 1);
            publish(**made, what, 1, start);
            return {};
        }
        better.add(**made, samples);
        publish(better.mean(), what, better.samples(), start);
        return {};
    }

    Result<> follow() {
        std::unique_lock lock(mutex);
        while (!stop) {
            const std::uint64_t of = changes;
            const Subject what = subject;
            if (!what.state || !what.light) {
                news.wait(lock, [&] { return stop || changes != of; });
                continue;
            }
            Result<> made;
            if (pictured != of) {
                lock.unlock();
                made = coarse(what, of);
                lock.lock();
                if (made && changes == of && !isWhole)
                    news.wait_for(lock, std::chrono::duration<double>(options.restsAfter),
                                  [&] { return stop || changes != of; });
            } else if (isWhole && better.samples() >= options.mostSamples) {
                done = true;
                news.wait(lock, [&] { return stop || changes != of; });
            } else {
                lock.unlock();
                made = refine(what, of);
                lock.lock();
            }
            if (!made) return made;
        }
        return {};
    }

    void run() {
        Result<> how;
        try {
            how = follow();
        } catch (const std::exception& e) {
            how = fail(fmt::format("pictures ended: {}", e.what()));
        }
        if (how) return;
        {
            const std::scoped_lock lock(mutex);
            failure = how.error().text;
        }
        if (options.wake) options.wake();
    }
};

LivePicture::LivePicture(SharedWorld& world, LivePictureOptions options)
    : impl_(std::make_unique<Impl>(world, std::move(options))) {
    impl_->thread = std::thread([i = impl_.get()] { i->run(); });
}
LivePicture::~LivePicture() = default;

Result<> LivePicture::show(const std::optional<Camera>& eye) {
    Impl& s = *impl_;
    auto state = s.world.present();
    if (!state) return std::unexpected(state.error());
    auto light = std::static_pointer_cast<const LightState>((*state)->of(s.number));
    if (!light) return fail(s.world.failure(s.tracer));
    const std::scoped_lock lock(s.mutex);
    if (!s.failure.empty()) return fail(s.failure);
    Impl::Subject next{std::move(*state), std::move(light), eye, s.subject.width, s.subject.height};
    const bool changed = s.differs(next);
    s.subject = std::move(next);
    if (changed) s.change();
    return {};
}

void LivePicture::setSize(int width, int height) {
    Impl& s = *impl_;
    const std::scoped_lock lock(s.mutex);
    if (s.subject.width == width && s.subject.height == height) return;
    s.subject.width = width, s.subject.height = height;
    s.change();
}

std::shared_ptr<const LivePictureShown> LivePicture::take() {
    const std::scoped_lock lock(impl_->mutex);
    return std::exchange(impl_->shown, nullptr);
}

LivePictureStatistics LivePicture::statistics() const {
    const std::scoped_lock lock(impl_->mutex);
    return impl_->statistics;
}

Result<Picture> LivePicture::picture(const RenderSettings& settings) const {
    Impl::Subject what;
    {
        const std::scoped_lock lock(impl_->mutex);
        what = impl_->subject;
    }
    what.width = settings.width, what.height = settings.height;
    auto camera = impl_->cameraOf(what);
    if (!camera) return std::unexpected(camera.error());
    return LightTracer::render(*what.light, *what.state->rays, *camera, settings);
}

bool LivePicture::isDone() const {
    const std::scoped_lock lock(impl_->mutex);
    return impl_->done;
}

}  // namespace rtsg
