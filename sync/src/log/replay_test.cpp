// Runs a replay test: compares the states of a recorded session with those of a scene that runs on its input.
#include <rtsg/sync/replay_test.h>

#include <charconv>
#include <cmath>
#include <cstdio>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include <rtsg/sync/log_check.h>

#include "replay_input.h"

namespace rtsg {

namespace {

class Run {
  public:
    Run(const ReplayTest& test, Replayer& recorded)
        : test_(test),
          recorded_(recorded),
          check_(recorded),
          input_(scene_, test.update || test.compared.any() ? &recorded.scene() : nullptr,
                 test.application ? ReplayInput::eventsOnly : ReplayInput::everything) {}

    ~Run() {
        std::error_code error;
        log_.reset();
        if (!fresh_.empty()) std::filesystem::remove(fresh_, error);
    }
    Run(const Run&) = delete;
    Run& operator=(const Run&) = delete;

    Result<ReplayReport> run() {
        if (auto ok = start(); !ok) {
            if (test_.finish) (void)test_.finish();  // the first error is the one to tell
            return std::unexpected(ok.error());
        }
        while (!done()) {
            if (test_.frame && recorded_.nextTime() != recorded_.scene().now()) frameIsWhole();
            if (done() || !next()) break;
            if (test_.build) {
                if (auto ok = rerunFrame(); !ok) {
                    diverge(ok.error().text);
                    break;
                }
            }
            ++report_.frames;
            if (fields_) fields_->changedA(recorded_.lastSet());
            compare();
        }
        frameIsWhole();
        takeDifferences();
        reportDamage();
        if (test_.finish)
            if (auto ok = test_.finish(); !ok) diverge(ok.error().text);
        if (log_)
            if (auto ok = replaceLog(); !ok) return std::unexpected(ok.error());
        return std::move(report_);
    }

  private:
    /// Notes what the scene under test changed in a frame, with edits of subscribers.
    class Changes final : public Subscriber {
      public:
        explicit Changes(FieldComparison& fields) : fields_(fields) {}
        Result<> apply(const Scene&, const ChangeSet& set) override {
            fields_.changedB(set);
            return {};
        }
        std::string subscriberName() const override { return "field comparison"; }

      private:
        FieldComparison& fields_;
    };

    bool byFields() const { return test_.compared.any() && !test_.update; }

    void takeDifferences() {
        report_.end = recorded_.scene().now();
        report_.closed = recorded_.log().closed();
        report_.goesOn = recorded_.log().goesOn();
        if (!fields_) return;
        report_.fields = fields_->fieldCount();
        report_.differences = fields_->differences();
        report_.histories = fields_->histories();
        if (!report_.differences.empty() && !done()) {
            const FieldDifference& d = report_.differences.front();
            report_.divergence = Divergence{d.frame, d.time, d.node, d.field,
                                            d.cause.empty() ? d.text : fmt::format("{}, by {}", d.text, d.cause)};
            if (const std::string late = lateBegin(); !late.empty()) report_.divergence->text += "; " + late;
        }
        report_.ignoredInVain = fields_->ignoredInVain();
        if (std::string why = fields_->nothingCompared(); !why.empty() && !done())
            report_.divergence = Divergence{0, report_.end, {}, {}, std::move(why)};
    }

    /// Only a complete log may replace the old one, which is all that is left of the session.
    Result<> replaceLog() {
        attachment_.detach();
        Result<> closed = log_->close();
        std::error_code error;
        if (!closed || done()) return closed;
        std::filesystem::rename(fresh_, std::filesystem::canonical(test_.log), error);
        if (error) return fail(error.message(), {}, test_.log.string());
        fresh_.clear();
        report_.updated = true;
        return {};
    }

    Scene& scene() { return test_.build ? scene_ : recorded_.scene(); }
    bool done() const { return report_.divergence.has_value(); }

    void diverge(std::string text) {
        if (done()) return;
        const Scene& s = recorded_.scene();
        report_.divergence = Divergence{s.sequence(), s.now(), {}, {}, std::move(text)};
    }

    /// The causes of the first state of a later piece are in earlier pieces.
    Result<> checkBegin() const {
        const std::optional<double> began = recorded_.head().start;
        const double before = began ? recorded_.scene().now() - *began : 0;
        if (!test_.build || !(before > 0)) return {};
        return fail(fmt::format("this is a later piece of a log, from {:.6g} s on: a scene can be run again from the "
                                "session's start only, so join the pieces first (cat)",
                                before),
                    {}, test_.log.string());
    }

    /// Says that the log begins with a later state of its session than the scene does: a mirror came late, or the
    /// beginning was cut off. Empty if it does not.
    std::string lateBegin() const {
        if (!test_.build || first_ <= firstNow_) return {};
        return fmt::format(
            "the log begins with state {} of its session, the scene with state {}: only what begins "
            "with the session can be run again",
            first_, firstNow_);
    }

    /// Takes the first state, before anything runs.
    Result<> start() {
        const Result<bool> first = check_.step();
        if (!first) return std::unexpected(first.error());
        if (!*first) return fail("no intact state", {}, test_.log.string());
        if (auto ok = checkBegin(); !ok) return ok;
        if (test_.build) {
            // Files that the scene loads must get the same time as in the session.
            if (const double t = recorded_.scene().now(); t > 0) scene_.newFrame(t);
            if (auto ok = test_.build(scene_); !ok) return ok;
            scene_.seal();
            input_.begin();
        }
        if (test_.attach)
            if (auto ok = test_.attach(scene()); !ok) return ok;
        if (test_.build && test_.update) {
            if (recorded_.log().beingWritten())
                return fail("another log writer has the file open", {}, test_.log.string());
            fresh_ = freshNameBeside(test_.log);
            auto log = LogWriter::create(fresh_, builtinTypes());
            if (!log) return std::unexpected(log.error());
            log_ = std::move(*log);
            attachment_ = scene_.bus().attach(*log_);
        }
        ++report_.frames;
        first_ = recorded_.scene().sequence();
        firstNow_ = scene_.sequence();
        report_.start = recorded_.scene().now();
        if (byFields()) {
            fields_ = std::make_unique<FieldComparison>(test_.compared, recorded_.scene(), scene_,
                                                        DifferenceWords{"recorded", "now"});
            changes_ = std::make_unique<Changes>(*fields_);
            changesAttachment_ = scene_.bus().attach(*changes_);
        }
        compare();
        return {};
    }

    /// Steps the recorded side and notes its faults.
    bool next() {
        const Result<bool> more = check_.step();
        if (!done()) report_.divergence = check_.firstLoss();
        return more && *more && !done();
    }

    /// Reports damage. All states may still have been compared, but the log is not as it was recorded.
    void reportDamage() {
        const std::optional<Divergence>& damage = check_.first();
        if (!damage) return;
        if (!done())
            report_.divergence = damage;
        else if (report_.divergence->text != damage->text)
            report_.divergence->text += "; before that, " + damage->text;
    }

    Result<> rerunFrame() {
        const ChangeSet& set = recorded_.lastSet();
        if (set.isSnapshot()) return fail("here another session begins in the log: only one can be run again");
        if (set.to != set.from + 1)
            return fail(
                fmt::format("states {} to {} were merged in the log, their input is gone", set.from + 1, set.to));
        if (test_.application)
            if (auto ok = test_.application(scene_, set.time); !ok) return ok;
        return input_.run(set);
    }

    void frameIsWhole() {
        if (done() || !test_.frame) return;
        if (auto ok = test_.frame(scene()); !ok) diverge(ok.error().text);
    }

    void compare() {
        const Scene& now = scene();
        if (log_) {
            if (!attachment_.attached()) return diverge(attachment_.failure());
            ++report_.verified;
        } else if (fields_) {
            if (report_.frames == 1 ? fields_->first() : fields_->compare())
                ++report_.verified;
            else
                reportDifference();
        } else if (now.hash() == recorded_.scene().hash()) {
            ++report_.verified;
        } else if (auto difference = firstDifference(recorded_.scene(), now, {"recorded", "now"})) {
            const std::string late = lateBegin();
            if (report_.frames == 1 && !late.empty())
                diverge(late);
            else
                report_.divergence = std::move(difference);
            reportDifference();
        } else {
            diverge("another hash, though no difference is to be seen");
        }
        if (!done() && test_.check)
            if (auto ok = test_.check(now); !ok) diverge(ok.error().text);
    }

    /// Reports only the first difference, as later ones mostly follow from it.
    void reportDifference() {
        if (test_.differ && test_.build && !std::exchange(differed_, true)) test_.differ(recorded_.scene(), scene());
    }

    const ReplayTest& test_;
    Replayer& recorded_;
    LogCheck check_;
    Scene scene_;
    InputPlayer input_;
    ReplayReport report_;
    std::filesystem::path fresh_;
    std::unique_ptr<LogWriter> log_;
    Attachment attachment_;
    std::unique_ptr<FieldComparison> fields_;
    std::unique_ptr<Changes> changes_;
    Attachment changesAttachment_;
    std::uint64_t first_ = 0, firstNow_ = 0;  // numbers of the first states
    bool differed_ = false;
};

}  // namespace

std::string ReplayReport::format() const {
    if (divergence) {
        Divergence since = *divergence;
        since.time = std::round((since.time - start) * 1e6) / 1e6;  // doubles of times since 1970 are that exact
        return since.format();
    }
    return fmt::format("{} of {} states as recorded{}{}", verified, frames,
                       fields > 0 ? fmt::format(" in {} fields", fields) : "",
                       updated ? "; the log was written anew" : "");
}

Result<ReplayReport> runReplayTest(const ReplayTest& test) {
    if (test.update && !test.build) return fail("only a rerun can update its log: there is no scene to record");
    if (test.compared.any() && !test.build)
        return fail("only a rerun can compare fields: a replay has no other values");
    if (auto ok = test.compared.check(); !ok) return std::unexpected(ok.error());
    if (!std::filesystem::exists(test.log))
        return fail("there is no log yet: record a session first", {}, test.log.string());
    auto recorded = Replayer::open(test.log);
    if (!recorded) return std::unexpected(recorded.error());
    return Run(test, **recorded).run();
}

namespace {

/// Returns false if the arguments are wrong.
bool parseTestArguments(int argc, char** argv, ReplayTest& test) {
    if (argc < 2) return false;
    test.log = argv[1];
    for (int i = 2; i < argc; ++i) {
        const std::string_view option = argv[i];
        if (option == "--update") {
            test.update = true;
            continue;
        }
        if (++i == argc) return false;
        const std::string_view value = argv[i];
        if (option == "--field") {
            test.compared.fields.emplace_back(value);
        } else if (option == "--ignore") {
            test.compared.ignore.emplace_back(value);
        } else if (option == "--tolerance") {
            const auto [end, problem] =
                std::from_chars(value.data(), value.data() + value.size(), test.compared.tolerance);
            if (problem != std::errc() || end != value.data() + value.size()) return false;
        } else {
            return false;
        }
    }
    return true;
}

}  // namespace

int replayTestMain(int argc, char** argv, ReplayTest test) {
    if (!parseTestArguments(argc, argv, test)) {
        std::fprintf(stderr,
                     "usage: %s LOG [--update] [--field NODE.FIELD]... [--ignore NODE.FIELD]... [--tolerance N]\n",
                     argc > 0 ? argv[0] : "test");
        return 2;
    }
    const Result<ReplayReport> report = runReplayTest(test);
    if (!report) {
        std::fprintf(stderr, "%s\n", report.error().format().c_str());
        return 1;
    }
    for (const std::string& p : report->ignoredInVain)
        fmt::print(stderr, "warning: --ignore {}: there is no such field\n", p);
    fmt::print(report->passed() ? stdout : stderr, "{}: {}\n", argv[1], report->format());
    return report->passed() ? 0 : 1;
}

}  // namespace rtsg
