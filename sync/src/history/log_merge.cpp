// Writes one log of two: their changes, with other numbers of nodes, in the order of their times.
#include <rtsg/sync/log_merge.h>

#include <array>
#include <memory>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/change_composer.h>
#include <rtsg/core/x3d.h>
#include <rtsg/sync/log_check.h>

#include "whole_log.h"

namespace rtsg {

namespace {

constexpr double kSame = 1e-6;                   // seconds; times since 1970 are exact to a quarter of that
constexpr std::uint32_t kMaxNodes = 0x7FFFFFFE;  // so that twice the number is one
constexpr std::array<NodeId, 2> kGroups = {NodeId{2}, NodeId{3}};
constexpr std::array<const char*, 2> kPrefixes = {"A_", "B_"};

/// Numbers of the scene's own node types as both sides define them.
struct OwnTypes {
    std::size_t next = builtinTypes().size();
};

/// Turns the changes of one of the two logs into changes of the scene that holds both.
class MergedSide {
  public:
    MergedSide(std::size_t which, OwnTypes& types) : which_(which), types_(types) {}

    /// `scene` is in the state that the set leads to.
    Result<ChangeSet> take(const Scene& scene, const ChangeSet& set) {
        ChangeSet turnedSet;
        for (const DefinedType& type : set.types) {
            if (types_.next > UINT16_MAX) return fail("there is no room for the node types of both");
            const TypeIndex own{static_cast<std::uint16_t>(types_.next++)};
            typeOf_[type.index.value] = own;
            turnedSet.types.push_back({own, type.type});
        }
        for (const Change& change : set.changes) {
            if (change.node.value > kMaxNodes || change.other.value > kMaxNodes)
                return fail(fmt::format("node #{}: there is no room for twice as many", change.node.value));
            if (auto created = turned(scene, change)) turnedSet.changes.push_back(std::move(*created));
        }
        if (set.authors) {
            auto authors = std::make_shared<std::vector<Authored>>(*set.authors);
            for (Authored& one : *authors) {
                if (one.node == scene.root() && one.field == x3d::RtsgScene::children.index)
                    one = {kGroups[which_], x3d::Transform::children.index, one.author};
                else
                    one.node = turned(one.node);
            }
            turnedSet.authors = std::move(authors);
        }
        return turnedSet;
    }

  private:
    NodeId turned(NodeId id) const {
        if (!id) return id;
        if (id.value == 1) return which_ == 0 ? id : kGroups[which_];
        return NodeId{static_cast<std::uint32_t>(2 * id.value + which_)};
    }
    Value turned(const Value& value) const {
        if (value.type() == FieldType::SFNode) return Value(turned(value.as<NodeId>()));
        if (value.type() != FieldType::MFNode) return value;
        Array<NodeId> ids;
        for (const NodeId id : value.as<Array<NodeId>>()) ids.push_back(turned(id));
        return Value(std::move(ids));
    }
    TypeIndex turned(TypeIndex type) const {
        const auto found = typeOf_.find(type.value);
        return found == typeOf_.end() ? type : found->second;
    }
    /// All fields of the root except its children are the first log's.
    std::optional<Change> turned(const Scene& scene, const Change& change) const {
        Change own = change;
        const bool ofRoot = change.node == scene.root();
        if (ofRoot && change.field == x3d::RtsgScene::children.index) {
            own.node = kGroups[which_];
            own.field = x3d::Transform::children.index;
        } else if (ofRoot && which_ != 0) {
            return std::nullopt;
        } else {
            own.node = turned(change.node);
        }
        own.other = turned(change.other);
        if (change.kind == ChangeKind::createNode || change.kind == ChangeKind::defineType)
            own.index = turned(TypeIndex{static_cast<std::uint16_t>(change.index)}).value;
        else if (change.kind == ChangeKind::setName)
            own.value = named(scene, change);
        else if (change.kind == ChangeKind::setField || change.kind == ChangeKind::event)
            own.value = turned(change.value);
        return own;
    }
    Value named(const Scene& scene, const Change& change) const {
        const String& name = change.value.as<String>();
        const Node* const node = scene.find(change.node);
        if (name.view().empty() || (node && node->scope())) return change.value;
        return Value(String(kPrefixes[which_] + name.str()));
    }

    std::size_t which_;
    OwnTypes& types_;
    std::unordered_map<std::uint32_t, TypeIndex> typeOf_;
};

/// One of the two logs, and its next state.
class MergedSource {
  public:
    MergedSource(std::size_t which, Replayer& replayer, OwnTypes& types)
        : replayer_(replayer), check_(replayer), side_(which, types) {}

    /// To the first state.
    Result<> begin() {
        bool more = true;
        while (more && replayer_.frames() == 0) more = check_.step().value_or(true);
        if (replayer_.frames() == 0) return fail("no intact state", {}, file());
        start_ = replayer_.time();
        return note(replayer_.scene().snapshot());
    }
    bool waits() const { return next_.has_value(); }
    /// The time of the next state.
    double time() const { return replayer_.time(); }
    double start() const { return start_; }
    const Replayer& replayer() const { return replayer_; }
    std::string file() const { return replayer_.log().file().string(); }
    std::uint64_t states() const { return replayer_.frames(); }

    /// The changes that lead to the next state; goes on to the one after it.
    Result<ChangeSet> take() {
        ChangeSet taken = std::move(*next_);
        next_.reset();
        const bool wasEmpty = replayer_.scene().sequence() == 0;  // the first state of a new scene is a snapshot, too
        const Result<bool> more = check_.step();
        if (!more) return std::unexpected(more.error());
        if (!*more) {
            check_.expectClosed();
            return taken;
        }
        if (replayer_.lastSet().isSnapshot() && !wasEmpty)
            return fail(fmt::format("begins anew at t = {:.6g} s, as its states have a gap there or another session "
                                    "begins; replay --compact with --seek and --for writes a part",
                                    replayer_.time() - start_),
                        {}, file());
        if (auto ok = note(replayer_.lastSet()); !ok) return std::unexpected(ok.error());
        return taken;
    }
    /// The first gap of the log; empty if there is none.
    std::string lacks() const {
        return check_.first() ? fmt::format("{}: {}", file(), check_.first()->text) : std::string();
    }

  private:
    Result<> note(const ChangeSet& set) {
        auto own = side_.take(replayer_.scene(), set);
        if (!own) return std::unexpected(own.error());
        next_ = std::move(*own);
        return {};
    }

    Replayer& replayer_;
    LogCheck check_;
    MergedSide side_;
    double start_ = 0;
    std::optional<ChangeSet> next_;
};

/// The two Transforms below which the logs' scenes are.
ChangeSet groups(float apart) {
    ChangeSet set;
    for (const NodeId group : kGroups) {
        Change& created = set.changes.emplace_back();
        created.kind = ChangeKind::createNode;
        created.node = group;
        created.index = x3d::Transform::type.value;
    }
    const auto setField = [&](NodeId node, FieldIndex field, Value value) {
        Change& change = set.changes.emplace_back();
        change.node = node;
        change.field = field;
        change.value = std::move(value);
    };
    Array<NodeId> both;
    for (const NodeId group : kGroups) both.push_back(group);
    setField(NodeId{1}, x3d::RtsgScene::children.index, Value(std::move(both)));
    if (apart != 0) setField(kGroups[1], x3d::Transform::translation.index, Value(Vec3f(apart, 0, 0)));
    for (std::size_t i = 0; i < kGroups.size(); ++i) {
        Change& name = set.changes.emplace_back();
        name.kind = ChangeKind::setName;
        name.node = kGroups[i];
        name.value = Value(String(std::string(1, kPrefixes[i][0])));
    }
    return set;
}

class Merging {
  public:
    Merging(Replayer& a, Replayer& b, LogWriter& to, const MergeOptions& options)
        : a_(0, a, types_), b_(1, b, types_), to_(to), options_(options) {
        scene_.setBehavioursEnabled(false);
    }

    Result<MergeReport> run() {
        for (MergedSource* const source : {&a_, &b_})
            if (auto ok = source->begin(); !ok) return std::unexpected(ok.error());
        std::vector<ChangeSet> sets;
        sets.push_back(groups(options_.apart));
        while (a_.waits() || b_.waits()) {
            const double time = std::min(a_.waits() ? timeOf(a_) : 1e300, b_.waits() ? timeOf(b_) : 1e300);
            for (MergedSource* const source : {&a_, &b_}) {
                if (!source->waits() || timeOf(*source) > time + kSame) continue;
                auto set = source->take();
                if (!set) return std::unexpected(set.error());
                sets.push_back(std::move(*set));
            }
            if (auto ok = write(sets, time); !ok) return std::unexpected(ok.error());
            sets.clear();
            const LogReader &first = a_.replayer().log(), &second = b_.replayer().log();
            if (options_.progress &&
                !options_.progress(first.position() + second.position(), first.size() + second.size()))
                return fail("cancelled");
        }
        for (const MergedSource* const source : {&a_, &b_})
            if (source->replayer().divergence())
                return fail(source->replayer().divergence()->format(), {}, source->file());
        return MergeReport{a_.states() + b_.states(), scene_.sequence(), a_.lacks().empty() ? b_.lacks() : a_.lacks()};
    }

  private:
    /// The time of its next state in the merged log.
    double timeOf(const MergedSource& source) const {
        return options_.bySceneTime ? source.time() : a_.start() + (source.time() - source.start());
    }
    /// Several sets become one state.
    Result<> write(std::vector<ChangeSet>& sets, double time) {
        auto set = std::make_shared<ChangeSet>();
        if (sets.size() == 1) {
            *set = std::move(sets.front());
        } else {
            ChangeComposer composer;
            for (std::size_t i = 0; i < sets.size(); ++i) {
                sets[i].from = scene_.sequence() + i;
                sets[i].to = sets[i].from + 1;
                composer.add(sets[i]);
            }
            *set = composer.take(&scene_);
        }
        set->from = scene_.sequence();
        set->to = set->from + 1;
        set->time = time;
        set->hash = {};
        if (auto ok = scene_.apply(set); !ok) return ok;
        set->hash = scene_.hash();
        return to_.apply(scene_, *set);
    }

    OwnTypes types_;
    MergedSource a_, b_;
    Scene scene_;
    LogWriter& to_;
    const MergeOptions& options_;
};

}  // namespace

Result<MergeReport> mergeLogs(const std::filesystem::path& a, const std::filesystem::path& b,
                              const std::filesystem::path& out, const MergeOptions& options) {
    for (const auto& in : {a, b})
        if (sameFile(in, out)) return fail("logs cannot be merged onto one of them", {}, in.string());
    MergeReport report;
    const auto done = writeWholeLog(out, options.log, [&](LogWriter& to) -> Result<> {
        auto first = Replayer::open(a);
        if (!first) return std::unexpected(first.error());
        auto second = Replayer::open(b);
        if (!second) return std::unexpected(second.error());
        auto merged = Merging(**first, **second, to, options).run();
        if (!merged) return std::unexpected(merged.error());
        report = std::move(*merged);
        return {};
    });
    if (!done) return std::unexpected(done.error());
    return report;
}

}  // namespace rtsg
