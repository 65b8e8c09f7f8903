// Plays a log and notes each state in which one field changed, with the cause.
#include <rtsg/sync/blame.h>

#include <algorithm>
#include <optional>
#include <unordered_set>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/field_path.h>
#include <rtsg/core/field_text.h>
#include <rtsg/sync/log_check.h>

#include "log/cause.h"

namespace rtsg {

namespace {

/// Follows one field through a log.
class Blame {
  public:
    explicit Blame(std::string_view path) : path_(path) {}

    /// Notes the present state of the replay. Error: the named thing holds no value.
    Result<> look(Replayer& replayer) {
        const Scene& scene = replayer.scene();
        if (!ofPart_) ofPart_ = showsAPart(scene, replayer.lastSet());
        const auto field = findField(scene, path_);
        touched_.clear();
        touched_.add(replayer.lastSet());
        if (replayer.lastSet().isSnapshot()) touched_.forget();
        if (!field) {
            if (!known_) why_ = field.error();
            before_.reset();
            return {};
        }
        // Later changes may follow from this one, even if the field itself does not change now.
        if (!replayer.lastSet().isSnapshot() && touched_.isFromOutside()) touched_.rememberStarts(scene, field->node);
        known_ = true;
        const Node& node = scene.node(field->node);
        if (!node.type().fields[field->field].readable())
            return fail(fmt::format("{} holds no value: it is an event", path_));
        const Value now = node.value(field->field);
        if (now == before_) return {};
        before_ = now;
        FieldStep& step = steps_.emplace_back();
        step.state = scene.sequence();
        step.time = replayer.time();
        step.value = fieldText(scene, path_).value_or("");
        if (replayer.lastSet().isSnapshot()) {
            step.cause = "as the log begins, or goes on";
            return {};
        }
        auto [cause, author, appeared, fromOutside] = touched_.cause(scene, field->node, field->field);
        if (appeared && author.empty()) appeared_.push_back(steps_.size() - 1);
        step.cause = std::move(cause);
        step.author = std::move(author);
        step.wasSet = step.cause == FrameTouches::kSetFromOutside;
        return {};
    }

    std::vector<FieldStep> steps() {
        for (const std::size_t i : appeared_) steps_[i].cause = ofPart_ ? "came into the part" : "came into the scene";
        return std::move(steps_);
    }
    /// Why the field was never found; null if it was.
    const Diagnostic* why() const { return known_ ? nullptr : &why_; }

  private:
    /// A scene numbers its nodes in the order in which they are made. If a node appears with a lower number than an
    /// older one, it existed before, outside the part of the scene that the log has.
    static bool showsAPart(const Scene& scene, const ChangeSet& set) {
        if (set.isSnapshot() || set.from == set.to) return false;
        std::unordered_set<std::uint32_t> created;
        std::uint32_t lowest = UINT32_MAX;
        for (const Change& c : set.changes) {
            if (c.kind != ChangeKind::createNode) continue;
            created.insert(c.node.value);
            lowest = std::min(lowest, c.node.value);
        }
        bool shows = false;
        if (!created.empty())
            scene.forEachNode(
                [&](const Node& node) { shows |= node.id().value > lowest && !created.contains(node.id().value); });
        return shows;
    }

    const std::string_view path_;
    FrameTouches touched_;
    std::vector<FieldStep> steps_;
    std::vector<std::size_t> appeared_;  // steps in which the node appeared, with no author
    std::optional<Value> before_;
    Diagnostic why_;
    bool known_ = false, ofPart_ = false;
};

}  // namespace

Result<std::vector<FieldStep>> blame(const std::filesystem::path& log, std::string_view path,
                                     const std::function<bool(std::uint64_t, std::uint64_t)>& progress,
                                     std::optional<Divergence>* lacks, std::optional<LaterPiece>* piece) {
    auto opened = Replayer::open(log);
    if (!opened) return std::unexpected(opened.error());
    Replayer& replayer = **opened;
    LogCheck check(replayer);
    Blame blamed(path);
    while (true) {
        const auto more = check.step();
        if (!more) continue;  // the next step goes on at the next keyframe
        if (!*more) break;
        if (progress && !progress(replayer.log().position(), replayer.log().size())) return blamed.steps();
        if (auto ok = blamed.look(replayer); !ok) return std::unexpected(ok.error());
    }
    // A log that is still being written is only taken as far as it goes.
    if (!replayer.log().beingWritten()) check.expectClosed();
    if (lacks) *lacks = check.first();
    if (piece) *piece = replayer.laterPiece();
    if (const Diagnostic* why = blamed.why()) return std::unexpected(*why);
    return blamed.steps();
}

}  // namespace rtsg
