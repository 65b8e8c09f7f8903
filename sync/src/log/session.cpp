// Brings a scene to the last state of a log, and starts its behaviours.
#include <rtsg/sync/session.h>

#include <deque>

#include <fmt/format.h>

#include <rtsg/core/frame_input.h>
#include <rtsg/sync/replay.h>

#include "log_files.h"

namespace rtsg {

namespace {

/// Keeps the newest sets, as many as wanted, each following the one before. It takes them from the replayed scene,
/// because a log in input mode has no changes.
class Recent final : public Subscriber {
  public:
    explicit Recent(const ResumeOptions& options) : options_(options) {}

    std::string subscriberName() const override { return "what peers may lack"; }
    Result<> apply(const Scene& scene, const ChangeSet& set) override {
        if (set.isSnapshot() || (!sets_.empty() && sets_.back()->to != set.from)) clear();
        if (set.isSnapshot()) return {};
        changes_ += set.changes.size();
        auto kept = std::make_shared<ChangeSet>(set);
        kept->hash = scene.hash();  // logs of earlier formats have another kind of hash
        sets_.push_back(std::move(kept));
        while (!sets_.empty() && (changes_ > options_.maxChanges || sets_.size() > options_.maxSets)) {
            changes_ -= sets_.front()->changes.size();
            sets_.pop_front();
        }
        return {};
    }
    std::vector<std::shared_ptr<const ChangeSet>> take() { return {sets_.begin(), sets_.end()}; }

  private:
    void clear() {
        sets_.clear();
        changes_ = 0;
    }

    const ResumeOptions& options_;
    std::deque<std::shared_ptr<const ChangeSet>> sets_;
    std::size_t changes_ = 0;
};

}  // namespace

namespace {

/// Reads the log to its end. Every state counts, because numbers of destroyed nodes must not be used again.
Result<std::unique_ptr<Replayer>> readThrough(const std::filesystem::path& log, Recent& recent, ResumedSession& session,
                                              const ResumeOptions& options) {
    auto opened = Replayer::open(log);
    if (!opened) return opened;
    Replayer& replayer = **opened;
    // Two writers must not continue one session.
    if (replayer.log().beingWritten()) return fail("another log writer has the file open", {}, log.string());
    const Attachment attachment = replayer.scene().bus().attach(recent);
    while (true) {
        const Result<bool> more = replayer.step();
        if (!more) {
            ++session.damaged;  // the next step goes on at the next keyframe
            continue;
        }
        if (!*more) break;
        const Scene& last = replayer.scene();
        if (session.epoch != replayer.head().epoch) session.start = replayer.head().start.value_or(last.now());
        session.epoch = replayer.head().epoch;
        ++session.states;
        if (options.progress) options.progress(replayer.log().position(), replayer.log().size());
    }
    session.damaged += replayer.log().damage().size();
    session.gaps = replayer.gaps();
    session.closed = replayer.log().closed();
    session.file = log;
    return opened;
}

/// True if the file has at most heads, because its writer or the disk got no further.
bool isWithoutStates(const std::filesystem::path& file) {
    if (isCutInHead(file)) return true;
    auto log = LogReader::open(file);
    if (!log) return false;
    while (const auto record = log->next())
        if (record->header.kind != RecordKind::head && record->header.kind != RecordKind::index) return false;
    return true;
}

}  // namespace

Result<ResumedSession> resumeSession(const std::filesystem::path& log, Scene& scene, const ResumeOptions& options) {
    if (scene.sequence() != 0 || scene.nodeCount() > 1) return fail("a session is resumed into an empty scene");
    const auto failed = [&](std::string text) { return fail(std::move(text), {}, log.string()); };
    Recent recent(options);
    ResumedSession session;
    const std::filesystem::path before =
        !isBeingWritten(log) && isWithoutStates(log) ? pieceBefore(log) : std::filesystem::path();
    auto opened = readThrough(before.empty() ? log : before, recent, session, options);
    if (!opened) return std::unexpected(opened.error());
    Replayer& replayer = **opened;
    if (session.states == 0) return failed("no intact state");
    // A piece must not be continued, because the session has gone on in a later file already.
    const auto later = before.empty() ? laterPiece(log) : std::filesystem::path();
    if (const auto head = headOf(later); head && head->epoch == session.epoch)
        return failed(fmt::format("its session went on in {}: resume that one, or a copy of this under another name",
                                  later.filename().string()));
    if (replayer.head().mode.mode == Mode::lossy)
        return failed("a lossy log holds what its readers had, not the scene itself");
    const ChangeSet state = replayer.scene().snapshot();
    if (const auto& divergence = replayer.divergence(); divergence && divergence->frame == state.to)
        return failed(divergence->format());
    session.end = state.time;
    session.before = recent.take();

    scene.setBehavioursEnabled(false);
    if (auto ok = scene.apply(std::make_shared<const ChangeSet>(state)); !ok) return std::unexpected(ok.error());
    if (scene.hash() != state.hash) return failed("its last state came out with another hash");
    RunState numbers = scene.runState();
    numbers.nextId = replayer.scene().runState().nextId;
    if (auto ok = scene.resumeFrom(numbers); !ok) return std::unexpected(ok.error());
    scene.setBehavioursEnabled(true);  // in the next frame every node that acts is asked again
    return session;
}

}  // namespace rtsg
