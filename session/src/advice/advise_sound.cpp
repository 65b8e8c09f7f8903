// Tries the settings of sound: figures of rooms, and the responses that are heard, against two long traces.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/audio/acoustic_renderer.h>
#include <rtsg/audio/room_metrics.h>

#include "trials.h"

namespace rtsg::advice {

namespace {

constexpr std::size_t kMaxSources = 4, kFirstBand = 2, kLastBand = 7;  // 125 Hz to 4 kHz
constexpr std::uint64_t kPilotRays = 500, kMinTruth = 2000, kMaxTruth = 1'000'000, kOfOrders = 8000;
constexpr double kPartForTruth = .4;
constexpr Bands RoomMetrics::* kFigures[] = {&RoomMetrics::edt, &RoomMetrics::t20, &RoomMetrics::c80, &RoomMetrics::d50,
                                             &RoomMetrics::g};

/// The figures of each source.
struct Measured {
    std::vector<RoomMetrics> figures;
    double cpu = 0, seconds = 0;
};

struct SettingTrial {
    std::string setting;
    TraceOptions options;
    std::uint64_t rays = 0;
    ErrorEstimate estimate;
    double cpu = 0;
    std::optional<Measured> first;  // of the first seed
};

/// Calls `visit` with products of differences from `a` and `b` in squares of the noticeable difference.
template <class Visit>
void compare(const RoomMetrics& x, const RoomMetrics& a, const RoomMetrics& b, Visit&& visit) {
    for (const auto figure : kFigures)
        for (std::size_t band = kFirstBand; band <= kLastBand; ++band) {
            const double p = (a.*figure)[band], q = (b.*figure)[band], value = (x.*figure)[band];
            const double noticeable = noticeableDifference(figure, (p + q) / 2);
            const double product = (value - p) * (value - q) / (noticeable * noticeable);
            if (std::isfinite(product)) visit(product);
        }
}

}  // namespace

std::string HeardSetting::text() const {
    return fmt::format(
        "--quality {}{}", figure(quality),
        diffraction == TraceOptions().diffractionOrder ? "" : fmt::format(" --diffraction {}", diffraction));
}

struct RoomTrials::Impl {
    Impl(SharedWorld& shared, const AdviceOptions& how) : world(shared), options(how) {
        AcousticOptions settings;
        settings.resources = options.resources, settings.document = options.document;
        auto created = AcousticRenderer::create(world.rays(), settings);
        if (!created) {
            failure = created.error().text;
            return;
        }
        sound = std::move(*created);
        world.add(*sound);
        const SoundScene& scene = sound->scene();
        for (const SoundEmitter& emitter : scene.emitters())
            if (scene.sound(emitter).enabled && scene.sound(emitter).reflected) emitters.push_back(emitter);
    }
    ~Impl() {
        if (sound) world.remove(*sound);
    }
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;

    Measured trace(TraceOptions tracing) const {
        const SoundScene& scene = sound->scene();
        const glm::dvec3 listener = scene.listener().position;
        const double cpu = cpuSeconds(), start = options.now();
        Measured result;
        for (std::size_t i = 0; i < std::min(emitters.size(), kMaxSources); ++i) {
            const glm::dvec3 position = scene.position(emitters[i]);
            result.figures.push_back(sound->trace(position, listener, tracing).metrics().value);
        }
        result.cpu = cpuSeconds() - cpu, result.seconds = options.now() - start;
        return result;
    }
    TraceOptions tracing(std::uint64_t rays, int diffraction) const {
        TraceOptions result;
        result.rays = rays, result.diffractionOrder = diffraction;
        result.goOn = [this] { return time->goesOn(); };
        result.lateral = true;
        result.air = air;
        return result;
    }

    void measure(const TrialTime& until, bool wantsRooms, bool wantsHeard) {
        time = &until, wanted = until.left(), asksRooms = wantsRooms, asksHeard = wantsHeard;
        air = sound->air();
        (void)trace(tracing(kPilotRays, 2));  // it builds what is needed
        if (!time->goesOn()) return;
        const Measured few = trace(tracing(kPilotRays, 2)), more = trace(tracing(8 * kPilotRays, 2));
        if (!time->goesOn()) return;
        perRay = std::max(1e-9, (more.seconds - few.seconds) / (7.0 * kPilotRays));
        fixed = std::max(0.0, few.seconds - perRay * kPilotRays);
        const double rays = (kPartForTruth * time->left() / 2 - fixed) / perRay;
        if (rays < kMinTruth) return;
        reference = std::min(static_cast<std::uint64_t>(rays), kMaxTruth);
        TraceOptions exact = tracing(reference, 2);
        exact.seed = options.seed + 1000;
        a = trace(exact);
        exact.seed = options.seed + 2000;
        b = trace(exact);
        known = time->goesOn();
        if (!known) return;
        noteReference();
        if (asksRooms) tryRooms();
        if (asksHeard) tryHeard();
    }

    /// The standard error that the truth's own error gives to each mean square.
    void noteReference() {
        double sum = 0, count = 0;
        for (std::size_t i = 0; i < a.figures.size(); ++i)
            compare(a.figures[i], b.figures[i], b.figures[i], [&](double square) { sum += square, ++count; });
        compared = count;
        if (count > 0) ofTruth = sum / 2 / count / std::sqrt(count);
    }

    void tryRooms() {
        std::vector<SettingTrial> list;
        const auto add = [&](std::uint64_t rays, int diffraction) {
            SettingTrial trial;
            trial.setting =
                fmt::format("--rays {}{}", rays, diffraction == 2 ? "" : fmt::format(" --diffraction {}", diffraction));
            trial.options = tracing(rays, diffraction), trial.rays = rays;
            list.push_back(std::move(trial));
        };
        for (std::uint64_t rays = kPilotRays; rays < kOfOrders; rays *= 4) add(rays, 2);
        for (const int order : {2, 1, 0}) add(kOfOrders, order);
        for (std::uint64_t rays = 4 * kOfOrders; rays <= reference / 4; rays *= 4) add(rays, 2);
        run(list, rooms, asksHeard ? .5 : 1);
    }

    void tryHeard() {
        std::vector<SettingTrial> list;
        for (const HeardSetting& setting : kHeard) {
            SettingTrial trial;
            trial.setting = setting.text();
            trial.options = AcousticOptions::heardTrace(setting.quality);
            trial.rays = trial.options.rays;
            trial.options.diffractionOrder = setting.diffraction, trial.options.air = air;
            trial.options.goOn = [this] { return time->goesOn(); };
            list.push_back(std::move(trial));
        }
        run(list, heard, 1);
    }

    /// Tries each with a few seeds, as the time allows; those without a result are left out.
    void run(std::vector<SettingTrial>& list, std::vector<SettingTrial>& into, double fraction) const {
        constexpr int kSeeds = 4, kFewest = 2;
        const double end = time->now() + fraction * time->left();
        for (SettingTrial& trial : list) {
            const double each = fixed + perRay * static_cast<double>(trial.rays);
            const int seeds = time->now() + kSeeds * each < end ? kSeeds : kFewest;
            if (time->now() + seeds * each > end) continue;
            int done = 0;
            for (; done < seeds; ++done) {
                trial.options.seed = options.seed + static_cast<std::uint64_t>(done);
                Measured measured = trace(trial.options);
                if (!time->goesOn()) break;
                add(trial, measured);
                trial.cpu += measured.cpu;
                if (!trial.first) trial.first = std::move(measured);
            }
            if (done < kFewest) continue;
            trial.cpu /= done;
            trial.estimate.widen(ofTruth);
            into.push_back(std::move(trial));
        }
    }
    void add(SettingTrial& trial, const Measured& measured) const {
        for (std::size_t i = 0; i < measured.figures.size(); ++i) {
            double sum = 0, count = 0;
            compare(measured.figures[i], a.figures[i], b.figures[i], [&](double product) { sum += product, ++count; });
            if (count > 0) trial.estimate.add(sum, count);
        }
    }

    std::string how() const {
        std::string text = fmt::format(
            "Errors are the root mean square over EDT, T20, C80, D50 and G from 125 Hz to 4 kHz, in noticeable "
            "differences "
            "(JND, ISO 3382-1), of {} source{}, against two traces of {} rays.",
            std::min(emitters.size(), kMaxSources), emitters.size() == 1 ? "" : "s", reference);
        if (emitters.size() > kMaxSources)
            text += fmt::format(" The scene has {} sources; these are the first.", emitters.size());
        return text;
    }

    /// What edges in a row bring, as differences with the same rays.
    void sayOrders(const std::vector<SettingTrial>& trials, std::uint64_t rays,
                   const std::function<double(const SettingTrial&)>& cost, AdviceTable& table, Plan& plan) const {
        const auto of = [&](int order) {
            return std::ranges::find_if(trials, [&](const SettingTrial& trial) {
                return trial.options.diffractionOrder == order && trial.rays == rays;
            });
        };
        constexpr const char* kWhat[] = {"One edge, and round bodies,", "Two edges in a row"};
        for (const int order : {2, 1}) {
            const auto with = of(order), without = of(order - 1);
            if (with == trials.end() || without == trials.end()) return;
            double sum = 0, count = 0;
            for (std::size_t i = 0; i < with->first->figures.size(); ++i)
                compare(with->first->figures[i], without->first->figures[i], without->first->figures[i],
                        [&](double square) { sum += square, ++count; });
            const double brought = count > 0 ? std::sqrt(sum / count) : 0;
            const double costs = 1 - cost(*without) / std::max(cost(*with), 1e-12);
            const bool needless = brought < kNotHeard && costs > kToSave;
            table.sentences.push_back(fmt::format("{} bring{} {} JND for {:.0f} % of the time{}", kWhat[order - 1],
                                                  order == 2 ? "" : "s", figure(brought), std::max(0.0, 100 * costs),
                                                  needless ? fmt::format(": --diffraction {}", order - 1) : ""));
            if (!needless) return;
            plan.diffraction = order - 1;
        }
    }

    /// The error as a number, or no number where nothing could be compared.
    static Trial trialOf(const SettingTrial& trial, double cost) {
        Trial result{trial.setting, {cost}};
        result.error = trial.estimate.error(), result.interval = trial.estimate.interval();
        return result;
    }

    void sayCheapest(AdviceTable& table, const std::string& before, const std::string& after) const {
        for (const double error : {2.0, 1.0, .5, .25, .1}) {
            const Trial* best = nullptr;
            for (const Trial& trial : table.trials)
                if (trial.error + trial.interval <= error && (!best || trial.costs[0] < best->costs[0])) best = &trial;
            if (best)
                table.sentences.push_back(fmt::format("For {} JND: rtsg listen {} {}{}{} ({} {})", figure(error),
                                                      quotedForShell(options.document), before, best->setting, after,
                                                      figure(best->costs[0]), table.costUnits[0]));
        }
        if (compared == 0)
            table.sentences.push_back("No figure of the room could be compared: no sound arrives, or it fades at once");
    }

    void finish(const std::vector<HeardCost>& costs, double seconds, Advice& advice) {
        const std::string why = fmt::format("{} s are too short", figure(wanted));
        if (asksRooms && rooms.empty()) advice.missing.push_back("rooms: " + why);
        if (!rooms.empty()) {
            AdviceTable table{Sense::rooms, how(), {"CPU-s"}, "JND", {}, {}, {}};
            for (const SettingTrial& trial : rooms) table.trials.push_back(trialOf(trial, trial.cpu));
            std::ranges::sort(table.trials, {}, [](const Trial& trial) { return trial.costs[0]; });
            markBeaten(table.trials);
            sayCheapest(table, "--metrics ", "");
            Plan ignored;
            sayOrders(rooms, kOfOrders, [](const SettingTrial& trial) { return trial.cpu; }, table, ignored);
            advice.tables.push_back(std::move(table));
        }
        if (!asksHeard) return;
        AdviceTable table{Sense::sound, how(), {"CPU-s a second"}, "JND", {}, {}, {}};
        std::vector<SettingTrial> played;
        const auto costOf = [&](const SettingTrial& trial) {
            for (std::size_t i = 0; i < costs.size(); ++i)
                if (kHeard[i].text() == trial.setting && costs[i].seconds > 0) return costs[i].cpu / costs[i].seconds;
            return -1.0;
        };
        for (const SettingTrial& trial : heard)
            if (costOf(trial) >= 0) table.trials.push_back(trialOf(trial, costOf(trial))), played.push_back(trial);
        if (table.trials.empty()) {
            advice.missing.push_back("sound: " + why);
            return;
        }
        table.how += fmt::format(
            " The errors are those of one response that is heard; costs are those of the first {} s.", figure(seconds));
        markBeaten(table.trials);
        sayCheapest(table, "-o OUT.wav ", "");
        sayOrders(played, AcousticOptions::kHeardRays, costOf, table, advice.plan);
        choose(table, advice.plan);
        advice.tables.push_back(std::move(table));
    }

    /// The cheapest quality that is noticeably right.
    static void choose(const AdviceTable& table, Plan& plan) {
        const Trial* best = nullptr;
        for (const Trial& trial : table.trials)
            if (trial.error + trial.interval <= 1 && (!best || trial.costs[0] < best->costs[0])) best = &trial;
        if (!best) return;
        plan.soundError = best->error;
        for (const HeardSetting& setting : kHeard)
            if (setting.text() == best->setting) plan.quality = setting.quality, plan.diffraction = setting.diffraction;
    }

    static constexpr double kNotHeard = .5, kToSave = .1;

    SharedWorld& world;
    const AdviceOptions& options;
    std::unique_ptr<AcousticRenderer> sound;
    std::string failure;
    const TrialTime* time = nullptr;
    std::vector<SoundEmitter> emitters;
    std::vector<SettingTrial> rooms, heard;
    Measured a, b;
    Air air;
    std::uint64_t reference = 0;
    double perRay = 0, fixed = 0, ofTruth = 0, wanted = 0, compared = 0;
    bool known = false, asksRooms = false, asksHeard = false;
};

RoomTrials::RoomTrials(SharedWorld& world, const AdviceOptions& options)
    : impl_(std::make_unique<Impl>(world, options)) {}
RoomTrials::~RoomTrials() = default;

const std::string& RoomTrials::failure() const {
    return impl_->failure;
}

bool RoomTrials::any() const {
    return !impl_->emitters.empty();
}

void RoomTrials::measure(const TrialTime& time, bool rooms, bool heard) {
    impl_->measure(time, rooms, heard);
}

void RoomTrials::finish(const std::vector<HeardCost>& costs, double seconds, Advice& advice) {
    impl_->finish(costs, seconds, advice);
}

}  // namespace rtsg::advice
