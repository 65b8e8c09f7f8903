// Tries the settings of pictures, against two long pictures by path with other seeds.
#include <algorithm>
#include <thread>

#include <fmt/format.h>

#include <rtsg/session/labels.h>
#include <rtsg/session/output_report.h>

#include "trials.h"

namespace rtsg::advice {

namespace {

constexpr int kBlock = 16, kMinWidth = 64, kReference = 128, kMaxReference = 4096, kMinReference = 8;
constexpr int kTrialSamples = 1 + 4 + 16 + 64 + 1 + 4 + 16 + 16;
constexpr double kFractionForTrials = .75, kFractionForTruth = .5;
constexpr double kToSay = .02;  // of the light: less is not worth a sentence

struct Shot {
    Picture picture;
    double cpu = 0, seconds = 0;
    RenderStats stats;
};

struct ShotSettings {
    Integrator integrator = Integrator::path;
    int samples = 1;
    std::uint64_t seed = 1;
    bool linear = false, error = false;
};

/// The mean of products of what two pictures differ from a third by, block by block.
struct Compared {
    ErrorEstimate estimate;
    double mean = 0;
};

float sumOf(const Vec4f& v) {
    return v.r + v.g + v.b;
}

/// `visit` gets the pixels of each block of 16 x 16 as numbers.
template <class Visit>
void forEachBlock(const Picture& picture, Visit&& visit) {
    std::vector<std::size_t> pixels;
    for (int y = 0; y < picture.height; y += kBlock)
        for (int x = 0; x < picture.width; x += kBlock) {
            pixels.clear();
            for (int j = y; j < std::min(y + kBlock, picture.height); ++j)
                for (int i = x; i < std::min(x + kBlock, picture.width); ++i)
                    pixels.push_back(static_cast<std::size_t>(j) * static_cast<std::size_t>(picture.width) +
                                     static_cast<std::size_t>(i));
            visit(pixels);
        }
}

class PictureTrials {
  public:
    PictureTrials(LightRenderer& light, const AdviceOptions& options, const TrialTime& time)
        : light_(light), options_(options), time_(time), seconds_(time.left()) {}

    std::optional<AdviceTable> run(Advice& advice) {
        const Result<> tried = tryAll();
        if (!tried || !isKnown_) {
            if (!time_.cancelled())
                advice.missing.push_back(
                    "pictures: " + (tried ? fmt::format("{} s are too short", figure(seconds_)) : tried.error().text));
            return std::nullopt;
        }
        predict();
        markBeaten(table_.trials);
        describe();
        say();
        choose(advice.plan);
        return std::move(table_);
    }

  private:
    const RenderSettings& asked() const { return options_.image.settings; }
    double fullPixels() const { return static_cast<double>(asked().width) * asked().height; }
    double pixels() const { return static_cast<double>(width_) * height_; }

    Result<Shot> take(const ShotSettings& wanted, int width, int height) {
        ImageOptions image = options_.image;
        image.keep = image.refine = false;
        RenderSettings& settings = image.settings;
        settings.integrator = wanted.integrator, settings.samplesPerPixel = wanted.samples;
        settings.seed = wanted.seed, settings.width = width, settings.height = height;
        settings.error = wanted.error ? 1e-6F : 0, settings.threads = options_.cores;
        if (wanted.linear) settings.colorSpace = ColorSpace::linear;
        settings.region = {}, settings.layers = 0, settings.shutter = 0;
        settings.progress = [this](double) { return time_.goesOn(); };
        Shot shot;
        const double cpu = cpuSeconds(), start = time_.now();
        auto picture = light_.picture(image, &shot.stats);
        shot.cpu = cpuSeconds() - cpu, shot.seconds = time_.now() - start;
        if (!picture) return std::unexpected(picture.error());
        shot.picture = toLinear(*std::move(picture));
        return shot;
    }
    /// Nothing if the time is up. A short trial is made thrice, since what else runs only adds to its cost.
    Result<std::optional<Shot>> shot(const ShotSettings& wanted, int width, int height) {
        constexpr double kShort = .05;
        std::optional<Shot> best;
        for (int i = 0; i < (best && best->cpu > kShort ? 1 : 3); ++i) {
            if (!time_.goesOn()) break;
            auto one = take(wanted, width, height);
            if (!one && !time_.goesOn()) break;
            if (!one) return std::unexpected(one.error());
            if (one->stats.cancelled) break;
            if (!best || one->cpu < best->cpu) best = *std::move(one);
        }
        return best;
    }

    /// The size and the samples of the two long pictures that the time allows.
    Result<bool> chooseSize() {
        const int width = std::clamp(asked().width / 8, kMinWidth, std::max(asked().width, 1));
        const int height = std::max(1, static_cast<int>(std::lround(double(width) * asked().height / asked().width)));
        const double count = static_cast<double>(width) * height;
        if (auto first = take({}, width, height); !first)
            return std::unexpected(first.error());  // it builds what is needed
        auto few = shot({}, width, height), more = shot({.samples = 4}, width, height);
        if (!few || !more) return std::unexpected(few ? more.error() : few.error());
        if (!*few || !*more) return false;
        const double slope = ((*more)->seconds - (*few)->seconds) / (3 * count);
        const double perSample = slope > 0 ? slope : std::max((*more)->seconds, 1e-6) / (4 * count);
        const double samples = time_.left() * kFractionForTrials / perSample;
        const double scale = std::min(1.0, std::sqrt(samples / (2 * kReference + kTrialSamples) / fullPixels()));
        width_ = std::clamp(static_cast<int>(asked().width * scale) / kBlock * kBlock,
                            std::min(kMinWidth, asked().width), asked().width);
        if (scale >= 1) width_ = asked().width;
        height_ = std::max(1, static_cast<int>(std::lround(double(width_) * asked().height / asked().width)));
        wanted_ = static_cast<int>(
            std::clamp((samples / pixels() - kTrialSamples) / 2, double(kMinReference), double(kMaxReference)));
        return true;
    }

    /// Adds to the two long pictures by turns, so that both are there whenever the time for them is up.
    Result<> takeTruth() {
        const double end = time_.now() + kFractionForTruth * time_.left();
        const int each = std::clamp(wanted_ / 8, 4, 64);
        std::uint64_t seed = options_.seed;
        while (reference_ < wanted_ && (reference_ == 0 || time_.now() < end)) {
            Shot halves[2];
            for (Shot& half : halves) {
                auto found = take({.samples = each, .seed = ++seed}, width_, height_);
                if (!found && time_.goesOn()) return std::unexpected(found.error());
                if (!found || found->stats.cancelled) return {};
                half = *std::move(found);
            }
            addTo(a_, halves[0], each), addTo(b_, halves[1], each);
            reference_ += each;
        }
        return {};
    }
    void addTo(Shot& sum, Shot& part, int samples) const {
        sum.seconds += part.seconds;
        if (reference_ == 0) {
            sum.picture = std::move(part.picture);
            return;
        }
        const float weight = static_cast<float>(samples) / static_cast<float>(reference_ + samples);
        for (std::size_t i = 0; i < sum.picture.pixels.size(); ++i)
            sum.picture.pixels[i] += (part.picture.pixels[i] - sum.picture.pixels[i]) * weight;
    }

    Result<> tryAll() {
        auto sized = chooseSize();
        if (!sized) return std::unexpected(sized.error());
        if (!*sized) return {};
        if (auto ok = takeTruth(); !ok) return ok;
        if (reference_ == 0) return {};
        mean_ = 0;
        for (std::size_t i = 0; i < a_.picture.pixels.size(); ++i)
            mean_ += double(sumOf(a_.picture.pixels[i]) + sumOf(b_.picture.pixels[i])) / 6 / pixels();
        if (!(mean_ > 0)) return fail("the picture is black");
        constexpr Integrator kPath = Integrator::path, kWhitted = Integrator::whitted;
        for (const ShotSettings& wanted :
             {ShotSettings{kWhitted, 1}, ShotSettings{kPath, 1}, ShotSettings{kWhitted, 4}, ShotSettings{kPath, 4},
              ShotSettings{kWhitted, 4, 1, true}, ShotSettings{kPath, 16, 1, false, true}, ShotSettings{kWhitted, 16},
              ShotSettings{kPath, 64, 1, false, true}}) {
            if (wanted.integrator == kPath && wanted.samples > 2 * reference_) continue;
            if (auto ok = tryOne(wanted); !ok) return ok;
        }
        isKnown_ = samplesOfPath_ > 0 && whittedOne_ > 0;
        return isKnown_ ? correctCosts() : Result<>();
    }

    Result<> tryOne(ShotSettings wanted) {
        wanted.seed = options_.seed;
        auto found = shot(wanted, width_, height_);
        if (!found) return std::unexpected(found.error());
        if (!*found) return {};
        const Shot& taken = **found;
        const bool path = wanted.integrator == Integrator::path;
        const ErrorEstimate estimate = compare(taken.picture);
        Trial trial{fmt::format("--integrator {} --spp {}{}", path ? "path" : "whitted", wanted.samples,
                                wanted.linear ? " --color-space linear" : ""),
                    {taken.cpu * fullPixels() / pixels()},
                    estimate.error() / mean_,
                    estimate.interval() / mean_};
        if (path) {
            addToPath(trial, wanted.samples, taken.cpu);
            if (wanted.error) {
                // The last two say how fast what --error asks for falls: light that few samples have met counts less
                // and less.
                if (stats_ && stats_->error > taken.stats.error && taken.stats.error > 0)
                    powerOfError_ = std::clamp(
                        std::log(stats_->error / taken.stats.error) / std::log(taken.stats.samples / stats_->samples),
                        kIndependent, kFastest);
                stats_ = taken.stats;
            }
        } else if (wanted.samples == 1) {
            whittedOne_ = taken.cpu, secondaryRays_ = taken.stats.secondaryRays;
        }
        if (wanted.linear) missing(taken.picture);
        table_.trials.push_back(std::move(trial));
        return {};
    }

    ErrorEstimate compare(const Picture& picture) const {
        ErrorEstimate estimate;
        forEachBlock(picture, [&](const std::vector<std::size_t>& block) {
            double sum = 0;
            for (const std::size_t i : block)
                for (int c = 0; c < 3; ++c)
                    sum += double(picture.pixels[i][c] - a_.picture.pixels[i][c]) *
                           double(picture.pixels[i][c] - b_.picture.pixels[i][c]);
            estimate.add(sum, 3.0 * static_cast<double>(block.size()));
        });
        return estimate;
    }

    /// What whitted lacks, and has too much, over blocks, as fractions of all light.
    void missing(const Picture& picture) {
        double lacks = 0, extra = 0;
        forEachBlock(picture, [&](const std::vector<std::size_t>& block) {
            double difference = 0;
            for (const std::size_t i : block)
                difference += double(sumOf(a_.picture.pixels[i]) + sumOf(b_.picture.pixels[i])) / 2 -
                              double(sumOf(picture.pixels[i]));
            (difference > 0 ? lacks : extra) += std::abs(difference) / 3;
        });
        lacks_ = lacks / (mean_ * pixels()), extra_ = extra / (mean_ * pixels()), isCompared_ = true;
    }

    void addToPath(const Trial& trial, int samples, double cpu) {
        if (samples == 1)
            pathOne_ = cpu;
        else
            path_.perSample = (cpu - pathOne_) / (samples - 1);
        if (trial.error > 0) {
            // The last two errors say how fast it falls.
            if (samplesOfPath_ > 0 && lastError_ > 0)
                path_.power =
                    std::clamp(std::log(lastError_ / trial.error) / std::log(double(samples) / samplesOfPath_),
                               kIndependent, kEven);
            path_.errorOfOne = trial.error * std::pow(samples, path_.power);
            path_.relativeInterval = trial.interval / trial.error;
        }
        lastError_ = trial.error, samplesOfPath_ = samples;
    }

    /// A picture of one sample at the asked size says what the smaller size got wrong about costs.
    Result<> correctCosts() {
        double ofPath = fullPixels() / pixels(), ofWhitted = ofPath;
        const double seconds = 3 * a_.seconds / reference_ * ofPath;
        if (ofPath > 1 && seconds < time_.left()) {
            auto path = shot({.seed = options_.seed}, asked().width, asked().height);
            auto whitted = shot({Integrator::whitted, 1, options_.seed}, asked().width, asked().height);
            if (!path || !whitted) return std::unexpected(path ? whitted.error() : path.error());
            if (*path) ofPath = (*path)->cpu / std::max(pathOne_, 1e-9);
            if (*whitted) ofWhitted = (*whitted)->cpu / std::max(whittedOne_, 1e-9);
        }
        const double plain = fullPixels() / pixels();
        // The first sample has what a picture costs besides its samples, which does not grow with them.
        const auto corrected = [&](double cost, double one, double factor) {
            return std::max(0.0, (cost / plain - one) * plain) + one * factor;
        };
        for (Trial& trial : table_.trials) {
            const bool path = trial.setting.contains("path");
            trial.costs[0] = corrected(trial.costs[0], path ? pathOne_ : whittedOne_, path ? ofPath : ofWhitted);
        }
        path_.perSample = std::max(path_.perSample, 0.0) * plain;
        path_.fixed = std::max(0.0, pathOne_ * ofPath - path_.perSample);
        return {};
    }

    void predict() {
        for (const double error : {.1, .05, .02, .01}) {
            const double samples = path_.samplesFor(error);
            if (samples <= samplesOfPath_ || samples > kMaxSamples) continue;
            table_.trials.push_back({fmt::format("--integrator path --spp {:.0f}", samples),
                                     {path_.costOf(samples)},
                                     path_.errorAt(samples),
                                     path_.errorAt(samples) * path_.relativeInterval,
                                     true});
        }
        for (const double error : {.1, .05, .02}) {
            if (!stats_ || !(stats_->error > 0)) break;
            const double samples =
                std::max(kFirstLook, std::ceil(stats_->samples * std::pow(stats_->error / error, 1 / powerOfError_)));
            if (samples > kMaxByError) break;
            table_.trials.push_back({fmt::format("--integrator path --error {}", figure(error)),
                                     {path_.costOf(samples)},
                                     path_.errorAt(samples),
                                     path_.errorAt(samples) * path_.relativeInterval,
                                     true});
        }
        table_.path = path_;
    }

    void describe() {
        table_.costUnits = {"CPU-s a picture"};
        table_.errorUnit = "RMS / mean";
        table_.how = fmt::format(
            "Errors are the root mean square over the pixels of {} x {}, in linear light, divided by the mean, against "
            "two "
            "pictures by path of {} samples; costs are of {} x {}. Predicted: error as 1 / samples^{:.2g}.",
            width_, height_, reference_, asked().width, asked().height, path_.power);
    }

    std::string command(const std::string& setting) const {
        return fmt::format(
            "rtsg render {} -o OUT.png --size {}x{}{} {}", quotedForShell(options_.document), asked().width,
            asked().height,
            options_.image.viewpoint.empty() ? "" : " --viewpoint " + quotedForShell(options_.image.viewpoint),
            setting);
    }
    /// The cheapest trial that surely has at most this error, or null.
    const Trial* cheapest(double error) const {
        const Trial* best = nullptr;
        for (const Trial& trial : table_.trials)
            if (trial.error + (trial.predicted ? 0 : trial.interval) <= error * (1 + 1e-6) &&
                (!best || trial.costs[0] < best->costs[0]))
                best = &trial;
        return best;
    }

    void say() {
        std::vector<std::string>& out = table_.sentences;
        for (const double error : {.2, .1, .05, .02, .01}) {
            const Trial* best = cheapest(error);
            if (best)
                out.push_back(fmt::format("For {} %: {} ({} CPU-s)", figure(100 * error), command(best->setting),
                                          figure(best->costs[0])));
            else
                out.push_back(fmt::format("For {} %: nothing that was tried or can be predicted", figure(100 * error)));
        }
        sayDeadline();
        if (lacks_ > kToSay)
            out.push_back(
                fmt::format("{:.0f} % of this picture's light comes from other surfaces, from shining surfaces "
                            "or from the sky: whitted misses it",
                            100 * lacks_));
        if (extra_ > kToSay)
            out.push_back(
                fmt::format("Light that is not there, such as by ambient terms, is {:.0f} % in pictures by "
                            "whitted",
                            100 * extra_));
        if (isCompared_ && lacks_ <= kToSay && extra_ <= kToSay)
            out.push_back("whitted has the same light as path, within 2 %");
        sayUnseen();
    }

    void sayDeadline() {
        if (!(options_.picturesPerSecond > 0)) return;
        const double cores = options_.cores ? options_.cores : std::max(1U, std::thread::hardware_concurrency());
        const double budget = cores / options_.picturesPerSecond;
        const Trial *best = nullptr, *fastest = nullptr;
        for (const Trial& trial : table_.trials) {
            if (!fastest || trial.costs[0] < fastest->costs[0]) fastest = &trial;
            if (trial.costs[0] <= budget && (!best || trial.error < best->error)) best = &trial;
        }
        const std::string deadline = fmt::format(
            "At {} pictures a second on {:.0f} core{} ({} CPU-s each): ", figure(options_.picturesPerSecond), cores,
            cores == 1 ? "" : "s", figure(budget));
        if (best)
            table_.sentences.push_back(fmt::format("{}{}, error {}", deadline, best->setting, figure(best->error)));
        else if (fastest)
            table_.sentences.push_back(
                fmt::format("{}nothing; {} is the fastest, and fits at --size {}x{}", deadline, fastest->setting,
                            std::max(1, static_cast<int>(asked().width * std::sqrt(budget / fastest->costs[0]))),
                            std::max(1, static_cast<int>(asked().height * std::sqrt(budget / fastest->costs[0])))));
    }

    /// What no setting finds.
    void sayUnseen() {
        for (const Diagnostic& one : hiddenLightWarnings({}, stats_ ? stats_->hiddenLight : 0, 0))
            table_.sentences.push_back(one.text);
        if (stats_ && stats_->missing > 1e-3)
            table_.sentences.push_back(fmt::format(
                "Up to {:.1f} % of the light is missing, since paths end after 10,000 bounces", 100 * stats_->missing));
        bool lamps = false;
        light_.world().scene().forEachNode([&](const Node& node) {
            const std::string_view type = node.type().name;
            lamps = lamps || type == "PointLight" || type == "SpotLight" || type == "DirectionalLight";
        });
        if (lamps && secondaryRays_ > 0)
            table_.sentences.push_back(
                "Mirrors or clear surfaces are in this picture: what they throw of lights without size (PointLight, "
                "SpotLight, DirectionalLight) on other surfaces is not found by any setting");
    }

    void choose(Plan& plan) const {
        const Trial* best = cheapest(options_.error);
        if (!best) return;
        plan.integrator = best->setting.contains("path") ? "path" : "whitted";
        const std::size_t at = best->setting.find("--spp ");
        plan.samples = at == std::string::npos ? static_cast<int>(path_.samplesFor(best->error))
                                               : std::stoi(best->setting.substr(at + 6));
        plan.linear = best->setting.contains("linear");
        plan.pictureError = best->error;
    }

    static constexpr double kMaxSamples = 1 << 20, kMaxByError = 16384, kIndependent = .5, kEven = .75, kFastest = 2;
    static constexpr double kFirstLook = 8;  // samples, before which --error does not end a picture

    LightRenderer& light_;
    const AdviceOptions& options_;
    const TrialTime& time_;
    const double seconds_;
    AdviceTable table_;
    int width_ = 0, height_ = 0, wanted_ = 0, reference_ = 0, samplesOfPath_ = 0;
    Shot a_, b_;
    std::optional<RenderStats> stats_;  // of the last trial with errors
    double powerOfError_ = kIndependent;
    PathCost path_;
    std::uint64_t secondaryRays_ = 0;
    double mean_ = 0, lacks_ = 0, extra_ = 0, whittedOne_ = 0, pathOne_ = 0, lastError_ = 0;
    bool isKnown_ = false, isCompared_ = false;
};

}  // namespace

std::optional<AdviceTable> tryPictures(LightRenderer& light, const AdviceOptions& options, const TrialTime& time,
                                       Advice& advice) {
    return PictureTrials(light, options, time).run(advice);
}

}  // namespace rtsg::advice

namespace rtsg {

Result<BudgetChoice> chooseFor(LightRenderer& light, const ImageOptions& image, double cpuSeconds,
                               const std::function<bool()>& goOn) {
    constexpr double kForTrials = .1;
    AdviceOptions options;
    options.image = image, options.cores = image.settings.threads, options.seed = image.settings.seed + 1;
    options.goOn = goOn;
    // Trials end by the time of all threads, as the budget does.
    options.now = advice::cpuSeconds;
    const double start = options.now();
    BudgetChoice choice{image};
    choice.expectedError = std::numeric_limits<double>::quiet_NaN();
    RenderSettings& settings = choice.best.settings;
    settings.integrator = Integrator::whitted, settings.samplesPerPixel = 1;
    Advice found;
    const advice::TrialTime time(options, start + kForTrials * cpuSeconds);
    const auto table = advice::tryPictures(light, options, time, found);
    if (time.cancelled()) return fail("cancelled");
    choice.spent = options.now() - start;
    if (!table) return choice;
    const double left = cpuSeconds - choice.spent;
    for (const Trial& trial : table->trials)
        if (trial.setting.starts_with("--integrator whitted --spp ") && trial.costs[0] <= left &&
            !(choice.expectedError <= trial.error)) {
            choice.expectedError = trial.error;
            settings.samplesPerPixel = std::stoi(trial.setting.substr(27));
            settings.colorSpace = trial.setting.contains("linear") ? ColorSpace::linear : image.settings.colorSpace;
        }
    const PathCost& path = *table->path;
    const double samples = std::min(std::floor((left - path.fixed) / std::max(path.perSample, 1e-12)), 1048576.0);
    if (samples >= 1 && !(choice.expectedError <= path.errorAt(samples))) {
        choice.expectedError = path.errorAt(samples);
        settings.integrator = Integrator::path, settings.samplesPerPixel = static_cast<int>(samples);
        settings.colorSpace = image.settings.colorSpace;
    }
    return choice;
}

}  // namespace rtsg
