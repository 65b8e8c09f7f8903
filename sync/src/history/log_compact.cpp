// Writes a shorter log from a log: the states between two times, with frames merged, and the changes of chosen fields.
#include <rtsg/sync/log_compact.h>

#include <unordered_set>

#include <fmt/format.h>

#include <rtsg/core/change_composer.h>
#include <rtsg/sync/log_check.h>

#include "field_patterns.h"
#include "whole_log.h"

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

/// A scene of its own that follows the log's, but for changes of fields that are left out.
class FieldCut {
  public:
    static Result<std::unique_ptr<FieldCut>> make(const CompactOptions& options) {
        auto only = FieldPatterns::make(options.only);
        if (!only) return std::unexpected(only.error());
        auto without = FieldPatterns::make(options.without);
        if (!without) return std::unexpected(without.error());
        return std::make_unique<FieldCut>(std::move(*only), std::move(*without));
    }
    FieldCut(FieldPatterns only, FieldPatterns without) : only_(std::move(only)), without_(std::move(without)) {
        scene_.setBehavioursEnabled(false);
    }

    const Scene& scene() const { return scene_; }
    /// `whole` is in the state that the set leads to. Returns the set that leads the scene here to its own.
    Result<std::shared_ptr<const ChangeSet>> follow(const Scene& whole, const ChangeSet& set) {
        learn(whole, set);
        auto own = std::make_shared<ChangeSet>(set);
        own->input.reset();  // it does not lead to this scene's state
        own->hash = {};
        if (!set.isSnapshot()) {
            leaveOut(own->changes);
            leaveOutAuthors(*own);
        } else if (scene_.sequence() != 0) {
            if (auto ok = scene_.reset(); !ok) return std::unexpected(ok.error());
        }
        if (auto ok = scene_.apply(own); !ok) return std::unexpected(ok.error());
        own->hash = scene_.hash();
        return own;
    }
    /// Error: a pattern that has named no field.
    Result<> expectAllNamed() const {
        for (const FieldPatterns* const patterns : {&only_, &without_})
            if (const std::string none = patterns->matchedNothing(); !none.empty())
                return fail(
                    DiagnosticCode("no-such-field"),
                    fmt::format("no state has a field {} of values; nodes and lists of nodes always stay", none));
        return {};
    }

  private:
    static std::uint64_t keyOf(NodeId node, FieldIndex field) { return std::uint64_t{node.value} << 16 | field; }

    void learn(const Scene& whole, const ChangeSet& set) {
        created_.clear();
        bool renamed = set.isSnapshot();
        for (const Change& change : set.changes) {
            if (change.kind == ChangeKind::createNode) created_.insert(change.node.value);
            // The name of a scope is part of the names of all nodes in it.
            if (change.kind == ChangeKind::setName && !created_.contains(change.node.value)) renamed = true;
        }
        if (renamed) {
            inOnly_.clear();
            inWithout_.clear();
            whole.forEachNode([&](const Node& node) { learnNode(whole, node.id()); });
        } else {
            for (const std::uint32_t node : created_) learnNode(whole, NodeId{node});
        }
    }
    void learnNode(const Scene& whole, NodeId id) {
        noteFields(whole, id, only_, inOnly_);
        noteFields(whole, id, without_, inWithout_);
    }
    static void noteFields(const Scene& whole, NodeId id, FieldPatterns& patterns,
                           std::unordered_set<std::uint64_t>& into) {
        for (const FieldPatterns::Match& match : patterns.matches(whole, id)) {
            const NodeType& type = whole.node(id).type();
            for (FieldIndex field = 0; field < type.fieldCount(); ++field)
                if (sf(type.fields[field].type) != FieldType::SFNode &&
                    patterns.matches(match.pattern, type.fields[field].name))
                    into.insert(keyOf(id, field));
        }
    }

    bool stays(NodeId node, FieldIndex field) const {
        const std::uint64_t key = keyOf(node, field);
        return (only_.empty() || inOnly_.contains(key)) && !inWithout_.contains(key);
    }
    void leaveOut(std::vector<Change>& changes) const {
        std::erase_if(changes, [&](const Change& change) {
            if (change.kind == ChangeKind::event) return !stays(change.node, change.field);
            return change.kind == ChangeKind::setField && sf(change.value.type()) != FieldType::SFNode &&
                   !created_.contains(change.node.value) && !stays(change.node, change.field);
        });
    }
    /// Those of changes that were left out.
    void leaveOutAuthors(ChangeSet& set) const {
        if (!set.authors) return;
        std::unordered_set<std::uint64_t> there;
        for (const Change& change : set.changes)
            if (change.field != kNoField) there.insert(keyOf(change.node, change.field));
        auto authors = std::make_shared<std::vector<Authored>>(*set.authors);
        std::erase_if(*authors, [&](const Authored& one) {
            return one.field != kNoField && !there.contains(keyOf(one.node, one.field));
        });
        set.authors = authors->empty() ? nullptr : std::move(authors);
    }

    FieldPatterns only_, without_;
    Scene scene_;
    std::unordered_set<std::uint64_t> inOnly_, inWithout_;
    std::unordered_set<std::uint32_t> created_;  // in the present set
};

/// The states that are written: those of the log, or those of a scene with fewer changes.
class Written {
  public:
    Written(Merger& merger, FieldCut* cut) : merger_(merger), cut_(cut) {}
    Result<> take(const Scene& whole, const ChangeSet& set) {
        if (!cut_) return merger_.take(whole, set);
        const auto own = cut_->follow(whole, set);
        if (!own) return std::unexpected(own.error());
        return merger_.take(cut_->scene(), **own);
    }
    const Scene& scene(const Scene& whole) const { return cut_ ? cut_->scene() : whole; }

  private:
    Merger& merger_;
    FieldCut* cut_;
};

Result<CompactReport> compact(Replayer& from, LogWriter& to, const CompactOptions& options) {
    Merger merger(to);
    auto created = FieldCut::make(options);
    if (!created) return std::unexpected(created.error());
    const bool cuts = !options.only.empty() || !options.without.empty();
    Written written(merger, cuts ? created->get() : nullptr);
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
    if (auto ok = written.take(from.scene(), from.scene().snapshot()); !ok) return std::unexpected(ok.error());
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
            if (auto ok = merger.endSession(written.scene(scene)); !ok) return std::unexpected(ok.error());
        if (auto ok = written.take(scene, from.lastSet()); !ok) return std::unexpected(ok.error());
        if (merger.waiting() >= options.every && scene.now() - merger.lastTime() >= options.interval)
            if (auto ok = merger.flush(written.scene(scene)); !ok) return std::unexpected(ok.error());
    }
    if (auto ok = merger.flush(written.scene(from.scene())); !ok) return std::unexpected(ok.error());
    if (cuts)
        if (auto ok = (*created)->expectAllNamed(); !ok) return std::unexpected(ok.error());
    if (from.divergence()) return fail(from.divergence()->format(), {}, from.log().file().string());
    report.statesWritten = merger.written();
    report.damaged = from.log().damage().size();
    report.gaps = from.gaps() - gaps;
    if (check.first()) report.lacks = check.first()->text;
    return report;
}

}  // namespace

Result<CompactReport> compactLog(const std::filesystem::path& in, const std::filesystem::path& out,
                                 const CompactOptions& options) {
    if (sameFile(in, out)) return fail("a log cannot be compacted onto itself", {}, in.string());
    CompactReport report;
    std::unique_ptr<Replayer> from;  // opened once it is known that the log can be written
    const auto done = writeWholeLog(out, options.log, [&](LogWriter& to) -> Result<> {
        auto opened = Replayer::open(in);
        if (!opened) return std::unexpected(opened.error());
        from = std::move(*opened);
        auto created = compact(*from, to, options);
        if (!created) return std::unexpected(created.error());
        report = std::move(*created);
        return {};
    });
    if (!done) return std::unexpected(done.error());
    report.bytesWritten = std::filesystem::file_size(out);
    return report;
}

}  // namespace rtsg
