// Pictures the newest state on a thread of its own: coarsely while it changes, then whole, then better.
#include <rtsg/window/live_picture.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <set>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/worker.h>
#include <rtsg/renderers/denoise.h>
#include <rtsg/renderers/path_preview.h>

#include "clean_edges.h"
#include "live_picture_maker.h"

namespace rtsg {

namespace {

using Clock = std::chrono::steady_clock;

constexpr double kCoarsest = 0.25;  // of the width, and of the height; less in large windows:
constexpr double kCoarsestWidth = 320;
constexpr double kOfBudget = 0.9;  // the rest is for enlarging and showing
constexpr double kNewTimes = 0.3;  // the weight of the last picture in the mean
constexpr int kWidthStep = 16;     // widths change in steps, or pictures would swim
constexpr double kAnyAspect = 16. / 9;
constexpr double kFirstGuess = 2e-7;  // seconds a pixel
constexpr double kOfFirst = 0.6;      // of the budget, for the first picture after a rest: it answers somebody
// For pictures that reuse unchanged pixels: how much longer than the budget one may take; the share of the budget below
// which the next are larger; how long a larger one may take at first; and how often sizes change, in seconds.
constexpr double kLate = 1.25, kEarly = 0.6, kLargerAtFirst = 2.5, kSizeEvery = 0.5, kSizeAfterLate = 3;

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

/// How large pictures are while something changes.
class PictureSize {
  public:
    explicit PictureSize(double budget) : whole_(kOfBudget * budget), budget_(whole_) {}
    /// What showing takes is not there for making, up to half.
    void setShowing(double seconds) { budget_ = std::max(whole_ - seconds, whole_ / 2); }
    struct Size {
        int width = 0, height = 0;
    };
    /// A picture of which nothing is known before.
    Size fresh(int width, int height, bool isFirst) const {
        const double all = static_cast<double>(width) * height, time = budget_ * (isFirst ? kOfFirst : 1);
        return scaled(width, height, std::sqrt(time / (secondsAPixel_ * all)));
    }
    /// One by the same eye as the last, which was `last` wide and took `seconds`, since most of it was taken over.
    Size next(int width, int height, int last, double seconds, Clock::time_point now) {
        const double fraction = static_cast<double>(last) / width;
        if (last >= width || seconds > kEarly * budget_ || now < changes_) return scaled(width, height, fraction);
        changes_ = now + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(kSizeEvery));
        const double pixels = kLargerAtFirst * budget_ / secondsAPixel_, all = static_cast<double>(width) * height;
        return scaled(width, height,
                      std::max(fraction, std::min(fraction * std::sqrt(budget_ / seconds), std::sqrt(pixels / all))));
    }
    double latest() const { return kLate * budget_ / kOfBudget; }
    void wasLate(Clock::time_point now) {
        changes_ = now + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(kSizeAfterLate));
    }
    void took(double seconds, const Size& size) {
        secondsAPixel_ += kNewTimes * (seconds / (static_cast<double>(size.width) * size.height) - secondsAPixel_);
    }
    double secondsAPixel() const { return secondsAPixel_; }

  private:
    static Size scaled(int width, int height, double scale) {
        if (!(scale < 1)) return {width, height};
        scale = std::max(scale, std::min(kCoarsest, kCoarsestWidth / width));
        const int w =
            std::min(width, std::max(1, static_cast<int>(std::lround(scale * width / kWidthStep)) * kWidthStep));
        if (w == width) return {width, height};
        return {w, std::max(1, static_cast<int>(std::lround(static_cast<double>(w) * height / width)))};
    }

    const double whole_;  // seconds for a picture,
    double budget_;       // and for making it
    double secondsAPixel_ = kFirstGuess;
    Clock::time_point changes_{};  // not before
};

}  // namespace

struct LivePicture::Impl {
    /// The state and the eye of the next picture.
    struct Subject {
        std::shared_ptr<const WorldState> state;
        std::optional<Camera> eye;
        int width = 0, height = 0;
    };
    /// How a picture is to be made.
    struct Wish {
        int width = 0, height = 0, samples = 1;
        bool isMoving = false;  // it is made to its end, even if something changes
        bool keeps = false;     // takes over parts of the last picture, and leaves its own to the next
        double seconds = 0;     // it is given up after these; 0: never
        std::uint32_t layers = 0;
    };
    struct Created {
        Picture picture;
        Camera camera;
        RenderStats stats;
    };

    Impl(SharedWorld& w, LivePictureOptions o)
        : world(w),
          options(std::move(o)),
          maker(makeLivePictureMaker(world, options)),
          path(1 / options.toneMap.exposure),
          size(options.budget) {
        subject.width = options.settings.width, subject.height = options.settings.height;
    }
    SharedWorld& world;
    const LivePictureOptions options;
    std::unique_ptr<LivePictureMaker> maker;
    std::mutex making;                      // one picture at a time
    std::atomic<std::uint64_t> changes{0};  // of the visible content
    std::atomic<int> others{0};             // who wait for `making`
    std::atomic<double> showing{0};         // seconds
    std::atomic<std::uint64_t> starts{0};   // how often an eye that rested has begun to move
    // The scene's thread's own.
    std::optional<Camera> seenBy;
    bool eyeMoves = false;
    std::size_t taken = 0;        // of the renderer's diagnostics
    std::set<std::string> known;  // of the world's

    mutable std::mutex mutex;  // guards the members below
    std::condition_variable news;
    Subject subject;
    std::shared_ptr<const LivePictureShown> shown;
    LivePictureStatistics statistics;
    std::string failure;
    bool done = false, seen = true;

    // The thread's own.
    std::uint64_t pictured = 0;  // changes that the newest picture shows
    Accumulated better;
    PathPreview path;  // in its place, by that integrator
    PictureSize size;
    bool isComplete = false, rested = true, eyeRested = false;
    std::optional<Camera> keptBy;  // the eye of the picture whose pixels can be taken over
    int keptWidth = 0;
    double keptSeconds = 0;         // that the last one took
    Worker worker{"rtsg picture"};  // last: its job uses the others

    // ---- with `mutex` held -----------------------------------------------------------------------------------
    /// Whether the picture of `next` differs. A frame in which nothing that is seen has changed shares these.
    bool differs(const Subject& next) const {
        const Subject& now = subject;
        return !now.state || maker->differ(*now.state, *next.state) || now.width != next.width ||
               now.height != next.height || now.eye != next.eye;
    }
    /// On the scene's thread. Whoever begins to move waits for no picture of before.
    void noteEye(const Subject& next) {
        if (!maker->keeps(options.settings)) return;
        const auto camera = next.eye ? Result<Camera>(*next.eye) : maker->camera(*next.state, kAnyAspect);
        if (!camera) return;
        const bool moves = seenBy && *camera != *seenBy;
        if (moves && !eyeMoves) ++starts;
        eyeMoves = moves, seenBy = *camera;
    }
    void change() {
        ++changes;
        done = false;
        news.notify_all();
    }

    bool isPath() const { return options.settings.integrator == Integrator::path; }
    int samples() const { return isPath() ? path.samples() : better.samples(); }
    void forgetSamples() {
        better.clear();
        path.clear();
    }

    // ---- the thread ------------------------------------------------------------------------------------------
    /// Null: something has changed meanwhile, or it was given up.
    Result<std::optional<Created>> picture(const Subject& what, const Wish& wish, std::uint64_t of) {
        ImageOptions image;
        image.settings = options.settings;
        image.settings.width = wish.width, image.settings.height = wish.height;
        image.settings.samplesPerPixel = wish.samples;
        image.settings.seed = options.settings.seed + static_cast<std::uint64_t>(samples());
        image.settings.layers = wish.layers;
        image.keep = wish.keeps;
        const Clock::time_point start = Clock::now();
        const std::uint64_t startsBefore = starts;
        image.settings.progress = [&](double) {
            if (wish.seconds > 0 && secondsSince(start) > wish.seconds) return false;
            return wish.isMoving ? starts == startsBefore : changes == of && others == 0;
        };
        const std::scoped_lock lock(making);
        Created created;
        auto picture = maker->next(*what.state, image, {what.eye, what.width, what.height}, created.stats);
        if (!picture) return std::unexpected(picture.error());
        if (created.stats.cancelled) return std::optional<Created>();
        created.picture = std::move(*picture), created.camera = maker->camera();
        return std::optional(std::move(created));
    }

    void publish(const Picture& picture, const Camera& camera, const Subject& what, int samples,
                 Clock::time_point start, bool isMoving = false, double kept = 0) {
        auto next = std::make_shared<LivePictureShown>();
        next->width = picture.width, next->height = picture.height;
        next->pixels = windowPixels(picture, options.toneMap);
        if (!isComplete) cleanEdges(next->pixels, next->width, next->height);  // it is to be enlarged
        next->sequence = what.state->sequence;
        next->samples = samples;
        next->whole = isComplete;
        next->isMoving = isMoving;
        next->kept = kept;
        if (isComplete && isPath()) next->denoised = path.denoised(), next->noise = path.noise();
        next->seconds = secondsSince(start);
        next->camera = camera;
        {
            const std::scoped_lock lock(mutex);
            shown = std::move(next);
            ++(isComplete ? statistics.whole : statistics.moving);
            statistics.secondsAPixel = size.secondsAPixel();
        }
        if (options.wake) options.wake();
    }

    /// Whether the last picture was taken by the eye that is to see this one, so that some of it may stay.
    bool seenByTheSame(const Subject& what) const {
        if (!keptBy || !maker->keeps(options.settings)) return false;
        const double aspect = static_cast<double>(what.width) / what.height;
        if (what.eye) {
            Camera eye = what.eye->shaped(aspect);
            eye.layer = keptBy->layer;
            return eye == *keptBy;
        }
        const auto camera = maker->camera(*what.state, aspect);
        return camera && *camera == *keptBy;
    }

    /// Makes a picture with as many pixels as the budget allows, or the whole picture if that is all of them.
    Result<> coarse(const Subject& what, std::uint64_t of) {
        const Clock::time_point start = Clock::now();
        size.setShowing(showing);
        const bool isSame = seenByTheSame(what), eyeStarts = std::exchange(eyeRested, isSame) && !isSame;
        const PictureSize::Size fresh = size.fresh(what.width, what.height, std::exchange(rested, false) || eyeStarts);
        PictureSize::Size wanted = fresh;
        if (isSame) wanted = size.next(what.width, what.height, keptWidth, keptSeconds, start);
        const bool isLarger = wanted.width > fresh.width;
        if (!isLarger) wanted = fresh;
        forgetSamples();
        Wish wish{wanted.width, wanted.height, 1, true, maker->keeps(options.settings), 0, 0};
        if (isLarger) wish.seconds = wanted.width > keptWidth ? kLargerAtFirst * size.latest() : size.latest();
        const std::uint64_t startsBefore = starts;
        auto created = picture(what, wish, of);
        if (created && !*created && isLarger && starts == startsBefore) {
            size.wasLate(start);
            wanted = fresh, wish.width = fresh.width, wish.height = fresh.height, wish.seconds = 0;
            created = picture(what, wish, of);
        }
        if (!created) return std::unexpected(created.error());
        if (!*created) {  // there is a newer one to make
            keptBy.reset();
            return {};
        }
        const Created& one = **created;
        pictured = of;
        isComplete = wanted.width == what.width;
        publish(one.picture, one.camera, what, 1, start, true, one.stats.kept);
        const double spent = secondsSince(start);
        if (one.stats.kept == 0) size.took(spent, wanted);
        remember(one, wanted.width, spent);
        return {};
    }
    void remember(const Created& created, int width, double seconds) {
        keptBy = created.camera, keptWidth = width, keptSeconds = seconds;
    }

    Wish wishAtRest(const Subject& what) const {
        const int maximum = std::max(1, options.settings.samplesPerPixel);
        Wish wish{what.width, what.height, isComplete ? maximum : 1, false, !isComplete, 0, 0};
        if (!isPath()) return wish;
        if (isComplete) wish.samples = path.wanted(maximum);
        // Those of few samples know edges badly.
        if (path.samples() < 2 * maximum) wish.layers = kLayersOfDenoising;
        return wish;
    }
    /// The first whole picture, or one with more samples.
    Result<> refine(const Subject& what, std::uint64_t of) {
        const Clock::time_point start = Clock::now();
        const Wish wish = wishAtRest(what);
        auto created = picture(what, wish, of);
        if (!created) return std::unexpected(created.error());
        if (!*created) {
            const std::scoped_lock lock(mutex);
            ++statistics.cancelled;
            if (!isComplete) keptBy.reset();
            return {};
        }
        Created& one = **created;
        const bool isFirst = !std::exchange(isComplete, true);
        if (isPath()) {
            if (auto ok = path.add(std::move(one.picture), wish.samples); !ok) return ok;
            const Picture best = path.best([&] { return changes == of && others == 0; });
            publish(best, one.camera, what, samples(), start);
        } else if (isFirst) {
            publish(one.picture, one.camera, what, 1, start);
        } else {
            better.add(one.picture, wish.samples);
            publish(better.mean(), one.camera, what, samples(), start);
        }
        // The next change may leave most of the picture unchanged, so the next picture tries to reuse pixels.
        if (isFirst) remember(one, what.width, 0);
        return {};
    }

    Result<> follow() {
        std::unique_lock lock(mutex);
        while (!worker.stops()) {
            const std::uint64_t of = changes;
            const Subject what = subject;
            if (!what.state || !seen) {
                news.wait(lock, [&] { return worker.stops() || changes != of; });
                continue;
            }
            Result<> created;
            if (pictured != of) {
                lock.unlock();
                created = coarse(what, of);
                lock.lock();
                if (created && changes == of && !isComplete)
                    news.wait_for(lock, std::chrono::duration<double>(options.restsAfter),
                                  [&] { return worker.stops() || changes != of; });
            } else if (isGoodEnough()) {
                rested = done = true;
                news.wait(lock, [&] { return worker.stops() || changes != of; });
            } else {
                rested = true;
                lock.unlock();
                created = refine(what, of);
                lock.lock();
            }
            if (!created) return created;
        }
        return {};
    }

    bool isGoodEnough() const { return isComplete && samples() >= options.maxSamples; }
    /// Does one thing of what follow() does, on the scene's thread, where node renderers draw.
    Result<> step() {
        const std::uint64_t of = changes;
        const Subject what = subject;
        if (pictured != of) return coarse(what, of);
        rested = true;
        if (!isGoodEnough()) return refine(what, of);
        const std::scoped_lock lock(mutex);
        done = true;
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
    if (impl_->maker->ownsNodes()) return;
    impl_->worker.run([i = impl_.get()] { i->run(); },
                      [i = impl_.get()] {
                          const std::scoped_lock lock(i->mutex);
                          ++i->changes;
                          i->news.notify_all();
                      });
}
LivePicture::~LivePicture() = default;

Result<> LivePicture::show(const std::optional<Camera>& eye) {
    Impl& s = *impl_;
    if (auto ok = s.maker->open(); !ok) return ok;
    auto state = s.world.present();
    if (!state) return std::unexpected(state.error());
    if (!s.maker->renderer().tables(**state)) return fail(s.maker->renderer().failure());
    {
        const std::scoped_lock lock(s.mutex);
        if (!s.failure.empty()) return fail(s.failure);
        Impl::Subject next{std::move(*state), eye, s.subject.width, s.subject.height};
        const bool changed = s.differs(next);
        s.noteEye(next);
        s.subject = std::move(next);
        if (changed) s.change();
    }
    return s.maker->ownsNodes() && s.seen ? s.step() : Result<>();
}

void LivePicture::setSize(int width, int height) {
    Impl& s = *impl_;
    const std::scoped_lock lock(s.mutex);
    if (s.subject.width == width && s.subject.height == height) return;
    s.subject.width = width, s.subject.height = height;
    s.change();
}

void LivePicture::setShowing(double seconds) {
    impl_->showing = seconds;
}

void LivePicture::setSeen(bool on) {
    Impl& s = *impl_;
    const std::scoped_lock lock(s.mutex);
    if (std::exchange(s.seen, on) != on) s.change();
}

Diagnostics LivePicture::takeDiagnostics() {
    Impl& s = *impl_;
    Diagnostics news;
    const auto& all = s.maker->diagnostics().all();
    for (; s.taken < all.size(); ++s.taken) news.add(all[s.taken]);
    // The world joins lists that grow, so these are known by what they say.
    const Diagnostics ofWorld = s.world.diagnostics();
    for (const Diagnostic& one : ofWorld.all())
        if (s.known.insert(one.format()).second) news.add(one);
    return news;
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
    Impl& s = *impl_;
    ImageOptions image;
    image.settings = settings;
    image.keep = false;
    ++s.others;
    const std::scoped_lock turnLock(s.making);
    --s.others;
    Impl::Subject what;
    {
        const std::scoped_lock lock(s.mutex);
        what = s.subject;
    }
    if (!what.state) return fail("nothing has been shown yet");
    RenderStats stats;
    auto created = s.maker->next(*what.state, image, {what.eye, settings.width, settings.height}, stats);
    if (created && stats.cancelled) return fail("given up");
    return created;
}

std::string LivePicture::renderer() const {
    return impl_->maker->name();
}

bool LivePicture::isDone() const {
    const std::scoped_lock lock(impl_->mutex);
    return impl_->done;
}

}  // namespace rtsg
