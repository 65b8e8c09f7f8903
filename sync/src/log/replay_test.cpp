// A recorded session as a test: its states compared with those of a scene run afresh on its input.
#include <rtsg/sync/replay_test.h>

#include <cstdio>
#include <cstring>

#include <fmt/format.h>

#include "replay_input.h"

namespace rtsg {

namespace {

class Run {
  public:
    Run(const ReplayTest& test, Replayer& recorded)
        : test_(test),
          recorded_(recorded),
          input_(scene_, test.update ? &recorded.scene() : nullptr,
                 test.application ? ReplayInput::eventsOnly : ReplayInput::everything) {}

    ~Run() {
        std::error_code error;
        log_.reset();
        if (!fresh_.empty()) std::filesystem::remove(fresh_, error);
    }
    Run(const Run&) = delete;
    Run& operator=(const Run&) = delete;

    Result<ReplayReport> run() {
        if (auto ok = start(); !ok) return std::unexpected(ok.error());
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
            compare();
        }
        frameIsWhole();
        if (test_.finish)
            if (auto ok = test_.finish(); !ok) diverge(ok.error().text);
        if (log_)
            if (auto ok = replaceLog(); !ok) return std::unexpected(ok.error());
        return std::move(report_);
    }

  private:
    /// Only by one that is whole: the old one is all there is of the session.
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

    /// The first state, before anything runs.
    Result<> start() {
        const Result<bool> first = recorded_.step();
        if (!first) return std::unexpected(first.error());
        if (!*first) return fail("no intact state", {}, test_.log.string());
        if (test_.build) {
            // What is loaded is there from the same time on as in the session.
            if (const double t = recorded_.scene().now(); t > 0) scene_.newFrame(t);
            if (auto ok = test_.build(scene_); !ok) return ok;
            scene_.seal();
        }
        if (test_.attach)
            if (auto ok = test_.attach(scene()); !ok) return ok;
        if (test_.build && test_.update) {
            fresh_ = freshNameBeside(test_.log);
            auto log = LogWriter::create(fresh_, builtinTypes());
            if (!log) return std::unexpected(log.error());
            log_ = std::move(*log);
            attachment_ = scene_.bus().attach(*log_);
        }
        ++report_.frames;
        compare();
        return {};
    }

    /// Steps the recorded side, and says what of it cannot be trusted.
    bool next() {
        const std::uint64_t before = recorded_.scene().sequence();
        const Result<bool> more = recorded_.step();
        if (!more) diverge(more.error().text);
        if (!recorded_.log().damage().empty()) {
            const LogDamage& d = recorded_.log().damage().front();
            diverge(fmt::format("bytes {} to {} of the log are damaged: {}", d.offset, d.offset + d.length, d.text));
        }
        if (recorded_.gaps() > 0)
            diverge(fmt::format("states {} to {} are missing in the log", before + 1, recorded_.scene().sequence()));
        if (!done() && recorded_.divergence()) report_.divergence = recorded_.divergence();
        return more && *more && !done();
    }

    Result<> rerunFrame() {
        const ChangeSet& set = recorded_.lastSet();
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
        } else if (now.hash() == recorded_.scene().hash()) {
            ++report_.verified;
        } else if (auto difference = firstDifference(recorded_.scene(), now, {"recorded", "now"})) {
            report_.divergence = std::move(difference);
        } else {
            diverge("another hash, though no difference is to be seen");
        }
        if (!done() && test_.check)
            if (auto ok = test_.check(now); !ok) diverge(ok.error().text);
    }

    const ReplayTest& test_;
    Replayer& recorded_;
    Scene scene_;
    InputPlayer input_;
    ReplayReport report_;
    std::filesystem::path fresh_;
    std::unique_ptr<LogWriter> log_;
    Attachment attachment_;
};

}  // namespace

std::string ReplayReport::format() const {
    if (divergence) return divergence->format();
    return fmt::format("{} of {} states as recorded{}", verified, frames, updated ? "; the log was written anew" : "");
}

Result<ReplayReport> runReplayTest(const ReplayTest& test) {
    if (test.update && !test.build) return fail("only a rerun can update its log: there is no scene to record");
    auto recorded = Replayer::open(test.log);
    if (!recorded) return std::unexpected(recorded.error());
    return Run(test, **recorded).run();
}

int replayTestMain(int argc, char** argv, ReplayTest test) {
    const bool update = argc == 3 && std::strcmp(argv[2], "--update") == 0;
    if (argc != 2 && !update) {
        fmt::print(stderr, "usage: {} LOG [--update]\n", argc > 0 ? argv[0] : "test");
        return 2;
    }
    test.log = argv[1];
    test.update = update;
    const Result<ReplayReport> report = runReplayTest(test);
    if (!report) {
        fmt::print(stderr, "{}\n", report.error().format());
        return 1;
    }
    fmt::print(report->passed() ? stdout : stderr, "{}: {}\n", argv[1], report->format());
    return report->passed() ? 0 : 1;
}

}  // namespace rtsg
