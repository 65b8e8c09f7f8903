// Writes a shorter log from a log: the states between two times, with frames merged.
#include <rtsg/core/change_composer.h>
#include <rtsg/sync/log_compact.h>

#include <fmt/format.h>

#include <rtsg/sync/log_check.h>

namespace rtsg {

namespace {

/// Merges the sets that it gets until it must write.
class Merger {
  public:
    explicit Merger(LogWriter& log) : log_(log) {}

    Result<> take(const Scene& scene, const ChangeSet& set) {
        if (set.isSnapshot()) {
            // Frames were missing, or another session begins.
            if (auto ok = flush(scene); !ok) return ok;
            return write(scene, set);
        }
        composer_.add(set);
        ++waiting_;
        return {};
    }
    /// `scene` is in the state of the last set, or one state further.
    Result<> flush(const Scene& scene) {
        if (waiting_ == 0) return {};
        waiting_ = 0;
        return write(scene, composer_.take(&scene));
    }
    /// Flushes, and marks the session as complete.
    Result<> endSession(const Scene& scene) {
        if (auto ok = flush(scene); !ok) return ok;
        return log_.endSession();
    }
    std::uint64_t waiting() const { return waiting_; }
    std::uint64_t written() const { return written_; }
    double lastTime() const { return lastTime_; }

  private:
    Result<> write(const Scene& scene, const ChangeSet& set) {
        ++written_;
        lastTime_ = set.time;
        return log_.apply(scene, set);
    }

    LogWriter& log_;
    ChangeComposer composer_;
    std::uint64_t waiting_ = 0, written_ = 0;
    double lastTime_ = 0;
};

Result<CompactReport> compact(Replayer& from, LogWriter& to, const CompactOptions& options) {
    Merger merger(to);
    const bool seeks = options.from > -std::numeric_limits<double>::infinity();
    if (seeks)
        if (auto ok = from.seek(options.from); !ok) return std::unexpected(ok.error());
    LogCheck check(from);
    const std::uint64_t gaps = seeks ? from.gaps() : 0;
    for (bool more = true; more && from.frames() == 0;) more = check.step().value_or(true);
    if (from.frames() == 0) return fail("no intact state", {}, from.log().file().string());
    CompactReport report;
    report.bytesRead = from.log().size();
    report.statesRead = 1;
    if (auto ok = merger.take(from.scene(), from.scene().snapshot()); !ok) return std::unexpected(ok.error());
    while (true) {
        const std::uint64_t epoch = from.head().epoch, unclosed = from.unclosedSessions();
        const Result<bool> more = check.step();
        if (more && !*more) {
            check.expectClosed();
            break;
        }
        if (!more) continue;  // the next step goes on at the next keyframe
        if (options.progress && !options.progress(from.log().position(), from.log().size())) return fail("cancelled");
        const Scene& scene = from.scene();
        if (from.time() > options.to) break;
        ++report.statesRead;
        if (from.head().epoch != epoch && from.unclosedSessions() == unclosed)
            if (auto ok = merger.endSession(scene); !ok) return std::unexpected(ok.error());
        if (auto ok = merger.take(scene, from.lastSet()); !ok) return std::unexpected(ok.error());
        if (merger.waiting() >= options.every && scene.now() - merger.lastTime() >= options.interval)
            if (auto ok = merger.flush(scene); !ok) return std::unexpected(ok.error());
    }
    if (auto ok = merger.flush(from.scene()); !ok) return std::unexpected(ok.error());
    if (from.divergence()) return fail(from.divergence()->format(), {}, from.log().file().string());
    if (auto ok = to.close(); !ok) return std::unexpected(ok.error());
    report.statesWritten = merger.written();
    report.bytesWritten = to.bytes();
    report.damaged = from.log().damage().size();
    report.gaps = from.gaps() - gaps;
    if (check.first()) report.lacks = check.first()->text;
    return report;
}

}  // namespace

Result<CompactReport> compactLog(const std::filesystem::path& in, const std::filesystem::path& out,
                                 const CompactOptions& options) {
    std::error_code error;
    if (sameFile(in, out)) return fail("a log cannot be compacted onto itself", {}, in.string());
    if (options.log.existing == Existing::keep && std::filesystem::exists(out, error))
        return fail("there is a file already", {}, out.string());
    if (isBeingWritten(out)) return fail("another log writer has the file open", {}, out.string());
    auto from = Replayer::open(in);
    if (!from) return std::unexpected(from.error());
    const std::filesystem::path fresh = freshNameBeside(out);
    // Until the file is complete it has a temporary name that users do not know.
    const auto ofOut = [&](Diagnostic why) {
        if (why.file == fresh.string()) why.file = out.string();
        return std::unexpected(std::move(why));
    };
    Result<CompactReport> report;
    {
        auto to = LogWriter::create(fresh, builtinTypes(), options.log);
        if (!to) return ofOut(to.error());
        report = compact(**from, **to, options);
    }
    if (!report) report = ofOut(report.error());
    if (report) {
        const std::filesystem::path target = std::filesystem::exists(out) ? std::filesystem::canonical(out) : out;
        std::filesystem::rename(fresh, target, error);
        if (error) report = fail(error.message(), {}, out.string());
    }
    if (!report) std::filesystem::remove(fresh, error);
    return report;
}

}  // namespace rtsg
