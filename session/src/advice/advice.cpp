// Advice: divides the time among the senses, runs the scene, marks what is beaten, and writes what was found.
#include <rtsg/session/advice.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <fstream>
#include <iterator>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>

#include "trials.h"

namespace rtsg {

void markBeaten(std::span<Trial> trials) {
    const auto beats = [](const Trial& b, const Trial& a) {
        // Errors with intervals that overlap are not known to differ.
        if (!(b.error + b.interval <= a.error - a.interval)) return false;
        bool better = b.error + b.interval < a.error - a.interval;
        for (std::size_t i = 0; i < std::min(a.costs.size(), b.costs.size()); ++i) {
            if (!(b.costs[i] <= a.costs[i])) return false;
            better = better || b.costs[i] < a.costs[i];
        }
        return better;
    };
    for (Trial& a : trials)
        a.beaten = std::ranges::any_of(trials, [&](const Trial& b) { return &a != &b && beats(b, a); });
}

namespace advice {

double cpuSeconds() {
    timespec now{};
    ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec) * 1e-9;
}

double ErrorEstimate::square() const {
    double sum = 0, weight = 0;
    for (const Part& part : sums_) sum += part.sum, weight += part.weight;
    return weight > 0 ? sum / weight : std::numeric_limits<double>::quiet_NaN();
}

double ErrorEstimate::error() const {
    const double value = square();
    return value > 0 ? std::sqrt(value) : value <= 0 ? 0 : value;
}

double ErrorEstimate::interval() const {
    const double mean = square(), count = static_cast<double>(sums_.size());
    if (sums_.size() < 2 || !std::isfinite(mean)) return std::numeric_limits<double>::infinity();
    double sum = 0, weight = 0;
    for (const Part& part : sums_) sum += std::pow(part.sum - mean * part.weight, 2), weight += part.weight;
    const double spread = std::sqrt(sum * count / (count - 1)) / weight;
    const double half = studentT95(count - 1) * std::hypot(spread, extra_);
    const double value = std::sqrt(std::max(mean, 0.0));
    return std::max(value - std::sqrt(std::max(mean - half, 0.0)), std::sqrt(std::max(mean + half, 0.0)) - value);
}

std::string quotedForShell(const std::string& text) {
    const auto isPlain = [](unsigned char c) {
        return c > 127 || std::isalnum(c) || std::string_view("_-./:@%+=,").contains(static_cast<char>(c));
    };
    if (!text.empty() && std::ranges::all_of(text, isPlain)) return text;
    std::string quoted = "'";
    for (const char c : text) quoted += c == '\'' ? "'\\''" : std::string(1, c);
    return quoted + "'";
}

std::string figure(double value) {
    if (!std::isfinite(value)) return "unknown";
    std::string text = fmt::format("{:.2g}", value);
    if (std::abs(value) >= 100) text = fmt::format("{:.0f}", value);
    if (std::abs(value) < 1e-4 && value != 0) return text;
    for (std::size_t at = text.size(); std::abs(value) >= 1000 && at > 3 + (value < 0 ? 1 : 0);)
        text.insert(at -= 3, ",");
    if (text.starts_with("0.")) text.erase(0, 1);
    return text;
}

namespace {

constexpr double kFrame = 1 / 60.0, kMaxRun = 5, kFewestRun = .25;
constexpr std::size_t kMaxChanges = 500'000;

class Recorder final : public Subscriber {
  public:
    Result<> apply(const Scene& scene, const ChangeSet& changes) override {
        (void)scene;
        if (recorded.cut) return {};
        auto copy = std::make_shared<const ChangeSet>(changes);
        // A replica that joins anew begins with another snapshot.
        if (changes.isSnapshot()) recorded.first = copy, recorded.sets.clear();
        if (!changes.isSnapshot()) recorded.sets.push_back(std::move(copy)), count_ += changes.changes.size();
        recorded.cut = count_ > kMaxChanges;
        return {};
    }
    std::string subscriberName() const override { return "advice"; }
    Recorded recorded;

  private:
    std::size_t count_ = 0;
};

/// The stages in their order, with the time that each gets of what is left.
class Advising {
  public:
    Advising(SharedWorld& world, const AdviceOptions& options) : world_(world), options_(options) {
        start_ = options_.now(), end_ = start_ + options_.seconds;
        advice_.scene = options_.document;
        senses_ = options_.senses;
    }

    Result<Advice> run() {
        const double cpu = cpuSeconds();
        // The first frame: in the file, nothing is yet where behaviours put it.
        if (!options_.runTo(0)) return fail("the scene did not run");
        if (auto ok = world_.update(); !ok) return std::unexpected(ok.error());
        if (wantsAny({Sense::sound, Sense::rooms}) || senses_.empty())
            rooms_ = std::make_unique<RoomTrials>(world_, options_);
        chooseSenses();
        if (wants(Sense::pictures))
            if (auto ok = pictures(); !ok) return std::unexpected(ok.error());
        if (wantsAny({Sense::rooms, Sense::sound})) {
            const TrialTime time = timeOf(Stage::tracing);
            rooms_->measure(time, wants(Sense::rooms), wants(Sense::sound));
        }
        if (wantsAny({Sense::sound, Sense::mirror})) play();
        if (rooms_ && wantsAny({Sense::rooms, Sense::sound})) rooms_->finish(heard_, played_, advice_);
        if (wants(Sense::mirror))
            if (auto table = tryMirror(recorder_.recorded, options_, timeOf(Stage::coding), advice_))
                advice_.tables.push_back(std::move(*table));
        if (wants(Sense::touch))
            advice_.missing.push_back("touch: not measured; rtsg touch reports forces and late ticks");
        if (options_.goOn && !options_.goOn()) return fail("cancelled");
        std::ranges::sort(advice_.tables, {}, &AdviceTable::sense);
        advice_.seconds = options_.now() - start_, advice_.cpuSeconds = cpuSeconds() - cpu;
        advice_.diagnostics.append(world_.diagnostics());
        return std::move(advice_);
    }

  private:
    bool wants(Sense sense) const { return std::ranges::find(senses_, sense) != senses_.end(); }
    bool wantsAny(std::initializer_list<Sense> any) const {
        return std::ranges::any_of(any, [&](Sense sense) { return wants(sense); });
    }
    enum class Stage : std::uint8_t { pictures, tracing, playing, coding };
    bool isWanted(Stage stage) const {
        switch (stage) {
            case Stage::pictures:
                return wants(Sense::pictures);
            case Stage::tracing:
                return wantsAny({Sense::rooms, Sense::sound});
            case Stage::playing:
                return wantsAny({Sense::sound, Sense::mirror});
            case Stage::coding:
                return wants(Sense::mirror);
        }
        return false;
    }
    /// The time that a stage may take: its part of what is left for it and those after it.
    TrialTime timeOf(Stage stage) const {
        constexpr double kWeights[] = {.5, .25, .15, .1};
        double all = 0;
        for (auto i = static_cast<std::size_t>(stage); i < std::size(kWeights); ++i)
            if (isWanted(static_cast<Stage>(i))) all += kWeights[i];
        const double now = options_.now();
        return {options_, now + (end_ - now) * kWeights[static_cast<std::size_t>(stage)] / all};
    }

    void chooseSenses() {
        if (senses_.empty()) {
            if (world_.rays().stats().traced > 0) senses_.push_back(Sense::pictures);
            if (rooms_ && rooms_->any()) senses_.insert(senses_.end(), {Sense::sound, Sense::rooms});
            senses_.push_back(Sense::mirror);
        }
        if (!wantsAny({Sense::rooms, Sense::sound})) return;
        if (rooms_->any()) return;
        const std::string why =
            rooms_->failure().empty() ? "there is no source of sound that walls reflect" : rooms_->failure();
        for (const Sense sense : {Sense::sound, Sense::rooms})
            if (std::erase(senses_, sense) > 0) advice_.missing.push_back(fmt::format("{}: {}", nameOf(sense), why));
    }

    Result<> pictures() {
        LightRenderer light(world_, LightRenderer::Options(options_.resources));
        if (!light.attached()) return fail("pictures: " + light.failure());
        options_.context.extensions().registerWith(light);
        const TrialTime time = timeOf(Stage::pictures);
        if (auto table = tryPictures(light, options_, time, advice_)) advice_.tables.push_back(std::move(*table));
        advice_.diagnostics.append(light.diagnostics());
        return {};
    }

    /// Gives up the slowest of those that would not hear half a second in the time that is left.
    void dropSlow(std::vector<std::unique_ptr<SoundRenderer>>& sounds, const std::vector<double>& taken, double seconds,
                  double left) {
        constexpr double kWanted = .5, kSeen = .05;
        if (seconds < kSeen || seconds >= kWanted) return;
        double all = 0;
        std::size_t alive = 0, slowest = 0;
        for (std::size_t i = 0; i < sounds.size(); ++i) {
            if (!sounds[i]) continue;
            all += taken[i], ++alive;
            if (!sounds[slowest] || taken[i] >= taken[slowest]) slowest = i;
        }
        if (alive < 2 || all / seconds * (kWanted - seconds) <= left) return;
        sounds[slowest].reset(), heard_[slowest].seconds = 0;
    }

    /// Runs the scene; what hears it at all qualities, and what a mirror gets.
    void play() {
        const TrialTime time = timeOf(Stage::playing);
        std::vector<std::unique_ptr<SoundRenderer>> sounds;
        if (wants(Sense::sound)) {
            for (const HeardSetting& setting : kHeard) {
                ListenOptions listening;
                listening.metrics = listening.impulseResponses = false;
                listening.render.trace = AcousticOptions::heardTrace(setting.quality);
                listening.render.trace.diffractionOrder = setting.diffraction;
                listening.render.resources = options_.resources;
                listening.render.document = options_.document;
                sounds.push_back(std::make_unique<SoundRenderer>(world_, listening));
                options_.context.extensions().registerWith(*sounds.back());
            }
            heard_.resize(sounds.size());
        }
        const Attachment recording = wants(Sense::mirror) ? world_.scene().bus().attach(recorder_) : Attachment();
        bool hears = !sounds.empty();
        std::vector<double> taken(sounds.size());
        for (int frame = 1; frame * kFrame <= kMaxRun && time.goesOn(); ++frame) {
            if (!hears && !wants(Sense::mirror)) break;
            if (!options_.runTo(frame * kFrame)) break;
            if (!recorder_.recorded.cut) recorder_.recorded.seconds = frame * kFrame;
            hears = false;
            for (std::size_t i = 0; i < sounds.size(); ++i) {
                if (!sounds[i] || !time.goesOn()) continue;
                const double start = cpuSeconds(), since = options_.now();
                const bool good = sounds[i]->renderFrame().has_value();
                heard_[i].cpu += cpuSeconds() - start, taken[i] += options_.now() - since;
                heard_[i].seconds = frame * kFrame;
                if (!good) sounds[i].reset(), heard_[i].seconds = 0;
                hears = hears || good;
            }
            dropSlow(sounds, taken, frame * kFrame, time.left());
        }
        for (const HeardCost& cost : heard_) played_ = std::max(played_, cost.seconds);
        for (HeardCost& cost : heard_)
            if (cost.seconds < kFewestRun) cost.seconds = 0;
    }

    SharedWorld& world_;
    const AdviceOptions& options_;
    double start_ = 0, end_ = 0, played_ = 0;
    std::vector<Sense> senses_;
    Advice advice_;
    std::unique_ptr<RoomTrials> rooms_;
    std::vector<HeardCost> heard_;
    Recorder recorder_;
};

}  // namespace
}  // namespace advice

Result<Advice> advise(SharedWorld& world, const AdviceOptions& options) {
    AdviceOptions own = options;
    if (!own.now)
        own.now = [] {
            return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
        };
    return advice::Advising(world, own).run();
}

}  // namespace rtsg
