#include <rtsg/sync/replay.h>

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "node_label.h"

namespace rtsg {

namespace {

constexpr double kForever = std::numeric_limits<double>::infinity();

/// "node.field" of a change, as far as it has them.
void name(const Scene& scene, const Change& change, Divergence& into) {
    into.node = nodeLabel(scene, change.node);
    const Node* node = scene.find(change.node);
    if (change.kind == ChangeKind::setName)
        into.field = "name";
    else if (change.kind == ChangeKind::createNode || change.kind == ChangeKind::destroyNode)
        into.field = "existence";
    else if (node && change.field < node->type().fields.size())
        into.field = node->type().fields[change.field].name;
}

/// A value of `set` that is not in the scene after applying it: an error of the scene's, not of the log's.
const Change* firstUnheeded(const Scene& scene, const ChangeSet& set) {
    std::vector<NodeId> destroyed;
    for (const Change& change : set.changes)
        if (change.kind == ChangeKind::destroyNode) destroyed.push_back(change.node);
    std::ranges::sort(destroyed);
    for (const Change& change : set.changes) {
        if (change.kind != ChangeKind::setField || std::ranges::binary_search(destroyed, change.node)) continue;
        if (change.value.type() == FieldType::MFNode) continue;  // insertions may have followed
        const Node* node = scene.find(change.node);
        if (!node || change.field >= node->type().fields.size() ||
            !equalStorage(change.value.type(), node->storage(change.field), change.value.storage()))
            return &change;
    }
    return nullptr;
}

}  // namespace

Replayer::Replayer(LogReader log) : log_(std::move(log)), decoder_(builtinTypes()), scene_(std::make_unique<Scene>()) {
    scene_->setBehavioursEnabled(false);
}

Result<std::unique_ptr<Replayer>> Replayer::open(const std::filesystem::path& file) {
    Result<LogReader> log = LogReader::open(file);
    if (!log) return std::unexpected(log.error());
    std::unique_ptr<Replayer> replayer(new Replayer(std::move(*log)));
    const std::optional<LogReader::Record> first = replayer->log_.next();
    if (!first) return fail("the head record is gone", {}, file.string());
    if (auto ok = replayer->adoptHead(first->bytes); !ok) return std::unexpected(ok.error());
    return replayer;
}

Result<> Replayer::adoptHead(std::span<const std::byte> record) {
    Result<StreamHead> head = decodeHead(record, decoder_.localHash());
    if (!head) return fail(head.error().text, {}, log_.file().string());
    head_ = std::move(*head);
    lost_ = true;
    if (auto ok = decoder_.setHead(head_); !ok) return fail(ok.error().text, {}, log_.file().string());
    return {};
}

/// True when the record brought the scene to a further state.
Result<bool> Replayer::take(const LogReader::Record& record) {
    const RecordHeader& header = record.header;
    if (header.kind == RecordKind::head) {
        if (auto ok = adoptHead(record.bytes); !ok) return std::unexpected(ok.error());
        return false;
    }
    if (header.kind != RecordKind::frame && header.kind != RecordKind::keyframe) return false;
    const bool keyframe = header.kind == RecordKind::keyframe;
    const bool follows = !lost_ && header.from == scene_->sequence();
    if (!lost_ && !follows && header.to <= scene_->sequence()) return false;  // a keyframe for seeking only
    if (!follows) {
        if (!lost_) {
            lost_ = true;
            ++gaps_;
        }
        if (!keyframe) return false;
        if (scene_->sequence() != 0 || frames_ != 0)
            if (auto ok = scene_->reset(); !ok) return std::unexpected(ok.error());
    }
    // Subscribers may still hold the last one.
    if (!set_ || set_.use_count() > 1) set_ = std::make_shared<ChangeSet>();
    Result<> ok = decoder_.decode(record.bytes, *set_);
    if (ok) ok = scene_->apply(set_);
    if (!ok) {
        lost_ = true;
        return fail(fmt::format("at byte {}: state {}: {}", record.offset, header.to, ok.error().text), {},
                    log_.file().string());
    }
    lost_ = false;
    ++frames_;
    check(header, *set_);
    return true;
}

void Replayer::check(const RecordHeader& header, const ChangeSet& set) {
    if (scene_->hash() == header.hash) {
        ++verified_;
        return;
    }
    if (divergence_) return;
    Divergence found{header.to, header.time, {}, {}, {}};
    const Change* unheeded = firstUnheeded(*scene_, set);
    std::optional<Divergence> exact = unheeded ? std::nullopt : compareAtNextKeyframe();
    if (unheeded) {
        name(*scene_, *unheeded, found);
        found.text = "the scene does not hold the value that is in the log";
    } else if (exact) {
        found.node = std::move(exact->node);
        found.field = std::move(exact->field);
        found.text = fmt::format("{}, seen at the keyframe of state {}", exact->text, exact->frame);
    } else if (!set.changes.empty()) {
        const auto first = std::ranges::find_if(set.changes, [](const Change& c) {
            return c.kind != ChangeKind::defineType && c.kind != ChangeKind::event;
        });
        if (first != set.changes.end()) name(*scene_, *first, found);
        found.text = fmt::format("one of the {} changes of this state; this is the first", set.changes.size());
    }
    found.text += fmt::format(" (hash {}, recorded {})", scene_->hash().hex(), header.hash.hex());
    divergence_ = std::move(found);
}

/// Carries a copy of the scene on to where the log holds a whole state, and compares it with that.
std::optional<Divergence> Replayer::compareAtNextKeyframe() const {
    Result<LogReader> ahead = LogReader::open(log_.file());
    if (!ahead) return std::nullopt;
    ahead->seek(log_.position());
    ChangeDecoder decoder(builtinTypes(), decoder_.localHash());
    if (!decoder.setHead(head_) || !decoder.exact()) return std::nullopt;
    Scene suspect, truth;
    suspect.setBehavioursEnabled(false);
    truth.setBehavioursEnabled(false);
    if (!suspect.apply(std::make_shared<const ChangeSet>(scene_->snapshot()))) return std::nullopt;
    while (const std::optional<LogReader::Record> record = ahead->next()) {
        if (record->header.kind == RecordKind::head) return std::nullopt;
        if (record->header.kind != RecordKind::frame && record->header.kind != RecordKind::keyframe) continue;
        const auto set = std::make_shared<ChangeSet>();
        if (!decoder.decode(record->bytes, *set)) return std::nullopt;
        if (record->header.kind == RecordKind::frame) {
            if (!suspect.apply(set)) return std::nullopt;
            continue;
        }
        if (record->header.to != suspect.sequence() || !truth.apply(set)) return std::nullopt;
        return firstDifference(suspect, truth);
    }
    return std::nullopt;
}

Result<bool> Replayer::stepUntil(double time) {
    while (const std::optional<LogReader::Record> record = log_.next()) {
        const bool changes = record->header.kind == RecordKind::frame || record->header.kind == RecordKind::keyframe;
        if (changes && record->header.time > time && frames_ > 0) {
            log_.seek(record->offset);
            return false;
        }
        const Result<bool> moved = take(*record);
        if (!moved || *moved) return moved;
    }
    return false;
}

Result<bool> Replayer::step() {
    return stepUntil(kForever);
}

Result<> Replayer::seek(double time) {
    const std::vector<LogKeyframe>& keyframes = log_.keyframes();
    if (keyframes.empty()) return fail("no keyframe to start from", {}, log_.file().string());
    const LogKeyframe* best = &keyframes.front();
    for (const LogKeyframe& keyframe : keyframes)
        if (keyframe.time <= time) best = &keyframe;
    const bool ahead = !lost_ && scene_->now() <= time && best->offset < log_.position();
    if (!ahead) {
        log_.seek(best->head);
        const std::optional<LogReader::Record> head = log_.next();
        if (!head || head->header.kind != RecordKind::head)
            return fail(fmt::format("at byte {}: no head record", best->head), {}, log_.file().string());
        if (auto ok = adoptHead(head->bytes); !ok) return ok;
        log_.seek(best->offset);
        const Result<bool> first = step();
        if (!first) return std::unexpected(first.error());
    }
    while (true) {
        const Result<bool> moved = stepUntil(time);
        if (!moved) return std::unexpected(moved.error());
        if (!*moved) return {};
    }
}

Result<std::optional<Divergence>> diffLogs(const std::filesystem::path& a, const std::filesystem::path& b) {
    Result<std::unique_ptr<Replayer>> opened[] = {Replayer::open(a), Replayer::open(b)};
    for (const auto& log : opened)
        if (!log) return std::unexpected(log.error());
    Replayer &x = **opened[0], &y = **opened[1];
    Result<bool> moreX = x.step(), moreY = y.step();
    while (true) {
        for (const Result<bool>* more : {&moreX, &moreY})
            if (!*more) return std::unexpected(more->error());
        if (!*moreX || !*moreY) break;
        const Scene &s = x.scene(), &t = y.scene();
        if (s.sequence() == t.sequence()) {
            if (s.hash() != t.hash()) {
                if (auto difference = firstDifference(s, t)) return difference;
                return Divergence{s.sequence(), s.now(), {}, {}, "other hash"};
            }
            if (s.now() != t.now())
                return Divergence{s.sequence(), s.now(), {}, "time", fmt::format("{} s and {} s", s.now(), t.now())};
            moreX = x.step();
            moreY = y.step();
        } else if (s.sequence() < t.sequence()) {
            moreX = x.step();
        } else {
            moreY = y.step();
        }
    }
    if (*moreX == *moreY) return std::nullopt;
    const Replayer& longer = *moreX ? x : y;
    const Replayer& shorter = *moreX ? y : x;
    return Divergence{
        (*moreX ? x : y).scene().sequence(),
        (*moreX ? x : y).scene().now(),
        {},
        {},
        fmt::format("{} ends before {} does", shorter.log().file().string(), longer.log().file().string())};
}

}  // namespace rtsg
