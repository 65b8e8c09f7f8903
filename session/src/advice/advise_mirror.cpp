// Tries the codings of mirrors on what a scene has sent while it ran.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/core/bus.h>
#include <rtsg/core/rotation.h>
#include <rtsg/core/scene.h>
#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/lossy_scene.h>

#include "trials.h"

namespace rtsg::advice {

namespace {

using Sets = std::vector<std::shared_ptr<const ChangeSet>>;

struct StreamCost {
    double bytes = 0, cpu = 0, join = 0;  // join: bytes of the first state
};

class Collector final : public Subscriber {
  public:
    Result<> apply(const Scene& scene, const ChangeSet& changes) override {
        (void)scene;
        sets.push_back(std::make_shared<const ChangeSet>(changes));
        return {};
    }
    std::string subscriberName() const override { return "advice"; }
    Sets sets;
};

Result<StreamCost> costOf(const Sets& sets, const StreamMode& mode, const TrialTime& time) {
    ChangeEncoder encoder(mode);
    ChangeDecoder decoder(builtinTypes());
    ByteBuffer record;
    ChangeSet decoded;
    StreamCost cost;
    for (const auto& set : sets) {
        if (!time.goesOn()) return fail("the time is up");
        const double start = cpuSeconds();
        encoder.encode(*set, record);
        if (auto ok = decoder.decode(record.bytes(), decoded); !ok) return std::unexpected(ok.error());
        if (set == sets.front()) {
            cost.join = static_cast<double>(record.size());
            continue;
        }
        cost.cpu += cpuSeconds() - start;
        cost.bytes += static_cast<double>(record.size());
    }
    return cost;
}

/// How far two values of a moving field are apart: metres or the field's unit, and radians.
struct Distance {
    double metres = 0, radians = 0;
    void include(const Value& a, const Value& b) {
        if (a.type() != b.type()) return;
        if (a.holds<Vec3f>()) {
            const Vec3f p = a.as<Vec3f>(), q = b.as<Vec3f>();
            metres = std::max(metres, std::hypot(double(p.x) - q.x, double(p.y) - q.y, double(p.z) - q.z));
        } else if (a.holds<float>()) {
            metres = std::max(metres, std::abs(double(a.as<float>()) - b.as<float>()));
        } else if (a.holds<Rotation>()) {
            const glm::dquat p = toQuaternion(a.as<Rotation>()), q = toQuaternion(b.as<Rotation>());
            const glm::dquat d = glm::conjugate(p) * q;
            radians = std::max(radians, 2 * std::atan2(std::hypot(d.x, d.y, d.z), std::abs(d.w)));
        }
    }
};

struct LossySets {
    Sets sets;
    double cpu = 0;
    Distance distance;
};

/// The sets of a scene that follows the recorded one within `error`, and how far it was from it.
Result<LossySets> lossySets(const Recorded& recorded, double error, const TrialTime& time) {
    Scene copy;
    copy.setBehavioursEnabled(false);
    if (auto ok = copy.apply(recorded.first); !ok) return std::unexpected(ok.error());
    auto lossy = LossyScene::follow(copy, error);
    if (!lossy) return std::unexpected(lossy.error());
    Scene& followed = (*lossy)->scene();
    followed.setBehavioursEnabled(false);
    Collector collector;
    const Attachment attachment = followed.bus().attach(collector);
    LossySets result;
    for (const auto& set : recorded.sets) {
        if (!time.goesOn()) return fail("the time is up");
        const double start = cpuSeconds();
        if (auto ok = copy.apply(set); !ok) return std::unexpected(ok.error());
        result.cpu += cpuSeconds() - start;
        for (const Change& change : set->changes) {
            if (change.kind != ChangeKind::setField) continue;
            const Node *a = copy.find(change.node), *b = followed.find(change.node);
            if (a && b) result.distance.include(a->value(change.field), b->value(change.field));
        }
    }
    result.sets = std::move(collector.sets);
    return result;
}

/// What applying the sets to a scene alone costs, CPU seconds.
Result<double> applyingCost(const Recorded& recorded) {
    Scene copy;
    copy.setBehavioursEnabled(false);
    if (auto ok = copy.apply(recorded.first); !ok) return std::unexpected(ok.error());
    const double start = cpuSeconds();
    for (const auto& set : recorded.sets)
        if (auto ok = copy.apply(set); !ok) return std::unexpected(ok.error());
    return cpuSeconds() - start;
}

class MirrorTrials {
  public:
    MirrorTrials(const Recorded& recorded, const TrialTime& time) : recorded_(recorded), time_(time) {
        exact_.push_back(recorded.first);
        exact_.insert(exact_.end(), recorded.sets.begin(), recorded.sets.end());
    }

    Result<> run() {
        for (const Coding coding : {Coding::raw, Coding::compact, Coding::smallest})
            if (auto ok = add(fmt::format("--coding {}", nameOf(coding)), exact_, {Mode::state, coding, 0}, 0, 0); !ok)
                return ok;
        auto applying = applyingCost(recorded_);
        if (!applying) return std::unexpected(applying.error());
        for (const double error : {1e-4, 1e-3, 1e-2}) {
            auto lossy = lossySets(recorded_, error, time_);
            if (!lossy) return std::unexpected(lossy.error());
            const double worst = std::max(lossy->distance.metres, lossy->distance.radians);
            for (const Coding coding : {Coding::compact, Coding::smallest}) {
                const std::string setting =
                    fmt::format("--mode lossy --error {} --coding {}", figure(error), nameOf(coding));
                if (auto ok = add(setting, lossy->sets, {Mode::lossy, coding, error}, worst, lossy->cpu - *applying);
                    !ok)
                    return ok;
            }
            distances_.push_back(
                fmt::format("--mode lossy --error {}: at most {} m and {} rad from the origin's values while they "
                            "move, and exact at rest",
                            figure(error), figure(lossy->distance.metres), figure(lossy->distance.radians)));
        }
        return {};
    }

    AdviceTable table(const std::string& document) {
        AdviceTable table{
            Sense::mirror, {}, {"bytes a second", "CPU-ms a second"}, "m or rad", std::move(trials_), {}, {}};
        table.how = fmt::format(
            "The changes of {} s at 60 frames a second are coded and decoded, and nothing is sent; errors are the "
            "largest that were met. {}--mode input is not measured.",
            figure(recorded_.seconds), recorded_.cut ? "Recording stopped there, since so much changes. " : "");
        if (moving_ == 0) {
            table.sentences.push_back(
                fmt::format("Nothing changes in {} s: a mirror gets {} bytes when it joins, and then next to "
                            "nothing with any setting",
                            figure(recorded_.seconds), figure(join_)));
            return table;
        }
        markBeaten(table.trials);
        const auto best = std::ranges::min_element(table.trials, {},
                                                   [](const Trial& t) { return t.error > 0 ? INFINITY : t.costs[0]; });
        const auto fastest = std::ranges::min_element(
            table.trials, {}, [](const Trial& t) { return t.error > 0 ? INFINITY : t.costs[1]; });
        const auto command = [&](const Trial& trial) {
            return fmt::format("rtsg serve {} --bind tcp://*:5570 {} ({} bytes a second, {} CPU-ms a second)",
                               quotedForShell(document), trial.setting, figure(trial.costs[0]), figure(trial.costs[1]));
        };
        table.sentences.push_back("Bit for bit in the fewest bytes: " + command(*best));
        if (fastest != best) table.sentences.push_back("Bit for bit in the shortest time: " + command(*fastest));
        for (const Trial& trial : table.trials)
            if (trial.setting.contains("--error .001") && !trial.beaten) {
                table.sentences.push_back(fmt::format("Within a millimetre and a milliradian: {}", command(trial)));
                break;
            }
        std::ranges::move(distances_, std::back_inserter(table.sentences));
        table.sentences.push_back(fmt::format("A mirror gets {} bytes when it joins", figure(join_)));
        return table;
    }
    void count() {
        for (const auto& set : recorded_.sets) moving_ += set->changes.size();
    }

  private:
    Result<> add(const std::string& setting, const Sets& sets, const StreamMode& mode, double error, double more) {
        auto cost = costOf(sets, mode, time_);
        if (!cost) return std::unexpected(cost.error());
        const double seconds = std::max(recorded_.seconds, 1e-9);
        if (mode.mode == Mode::state && mode.coding == Coding::raw) join_ = cost->join;
        trials_.push_back({setting, {cost->bytes / seconds, 1e3 * (cost->cpu + std::max(more, 0.0)) / seconds}, error});
        return {};
    }

    const Recorded& recorded_;
    const TrialTime& time_;
    Sets exact_;
    std::vector<Trial> trials_;
    std::vector<std::string> distances_;
    double join_ = 0;
    std::size_t moving_ = 0;
};

}  // namespace

std::optional<AdviceTable> tryMirror(const Recorded& recorded, const AdviceOptions& options, const TrialTime& time,
                                     Advice& advice) {
    if (!recorded.first || !(recorded.seconds > 0)) {
        advice.missing.push_back("mirror: the scene did not run");
        return std::nullopt;
    }
    MirrorTrials trials(recorded, time);
    trials.count();
    if (auto ok = trials.run(); !ok) {
        if (!time.cancelled()) advice.missing.push_back("mirror: " + ok.error().text);
        return std::nullopt;
    }
    return trials.table(options.document);
}

}  // namespace rtsg::advice
