// Trials: what those of all senses share: a clock with an end, CPU time, and errors with intervals.
// Threading: the scene's thread.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/session/advice.h>

namespace rtsg::advice {

/// Of all threads of the process.
double cpuSeconds();

/// How long trials may go on, by the clock of the options, which outlive it.
class TrialTime {
  public:
    TrialTime(const AdviceOptions& options, double end) : options_(&options), end_(end) {}
    double now() const { return options_->now(); }
    double left() const { return end_ - now(); }
    bool cancelled() const { return options_->goOn && !options_->goOn(); }
    bool goesOn() const { return left() > 0 && !cancelled(); }

  private:
    const AdviceOptions* options_;
    double end_;
};

/// The root of a mean square and its 95 % interval, from sums over parts of the data that are nearly independent.
class ErrorEstimate {
  public:
    void add(double sum, double weight) { sums_.push_back({sum, weight}); }
    /// 0 if the sum is negative by chance.
    double error() const;
    double interval() const;
    /// The mean square has this standard error besides.
    void widen(double standardError) { extra_ = standardError; }

  private:
    struct Part {
        double sum, weight;
    };
    double square() const;
    std::vector<Part> sums_;
    double extra_ = 0;
};

/// Nothing if they could not be measured in the time; the reason is then in Advice::missing.
std::optional<AdviceTable> tryPictures(LightRenderer& light, const AdviceOptions& options, const TrialTime& time,
                                       Advice& advice);
/// A quality of played sound, and what playing it costs.
struct HeardSetting {
    double quality;
    int diffraction;
    std::string text() const;
};
inline constexpr HeardSetting kHeard[] = {{1, 2}, {1, 1}, {1, 0}, {.5, 2}, {2, 2}, {4, 2}};
struct HeardCost {
    double cpu = 0, seconds = 0;  // CPU seconds for so many of sound; 0: the time did not suffice
};

/// Figures of rooms by different settings, and those of the responses that are heard.
class RoomTrials {
  public:
    /// Both must outlive this object.
    RoomTrials(SharedWorld& world, const AdviceOptions& options);
    ~RoomTrials();
    RoomTrials(const RoomTrials&) = delete;
    RoomTrials& operator=(const RoomTrials&) = delete;
    /// Why there are no trials; empty if there can be.
    const std::string& failure() const;
    /// True if walls reflect any source of the scene.
    bool any() const;
    /// Makes the trials in the scene's present state.
    void measure(const TrialTime& time, bool rooms, bool heard);
    /// Adds the tables; `costs` has those of kHeard in their order, or nothing if they were not asked for.
    void finish(const std::vector<HeardCost>& costs, double seconds, Advice& advice);

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// Sets of changes of a scene that runs, from `first` on.
struct Recorded {
    std::shared_ptr<const ChangeSet> first;  // a snapshot
    std::vector<std::shared_ptr<const ChangeSet>> sets;
    double seconds = 0;
    bool cut = false;  // there were too many to keep all
};
std::optional<AdviceTable> tryMirror(const Recorded& recorded, const AdviceOptions& options, const TrialTime& time,
                                     Advice& advice);

/// As a shell takes it for one word.
std::string quotedForShell(const std::string& text);
/// ".042", "1.3", "12", "1,200".
std::string figure(double value);

}  // namespace rtsg::advice
