// Plays a log into a scene, checks each state, and finds where two logs differ.
#include <rtsg/core/change_composer.h>
#include <rtsg/sync/replay.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "codec/node_label.h"
#include "index.h"
#include "replay_input.h"

namespace rtsg {

namespace {

/// Puts the names of a change's node and field into a divergence, as far as it has them.
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

/// Finds a value of `set` that the scene does not have after applying it. That is an error of the scene, not of the
/// log.
const Change* firstUnheeded(const Scene& scene, const ChangeSet& set) {
    std::vector<NodeId> destroyed;
    for (const Change& change : set.changes)
        if (change.kind == ChangeKind::destroyNode) destroyed.push_back(change.node);
    std::ranges::sort(destroyed);
    for (const Change& change : set.changes) {
        if (change.kind != ChangeKind::setField || std::ranges::binary_search(destroyed, change.node)) continue;
        if (change.value.type() == FieldType::MFNode) continue;  // the change may be followed by insertions
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
    decoder_.countOriginHash();
}

Result<std::unique_ptr<Replayer>> Replayer::open(const std::filesystem::path& file, std::uint64_t maxPayload) {
    Result<LogReader> log = LogReader::open(file, maxPayload);
    if (!log) return std::unexpected(log.error());
    std::unique_ptr<Replayer> replayer(new Replayer(std::move(*log)));
    while (const std::optional<LogReader::Record> record = replayer->log_.next()) {
        if (record->header.kind != RecordKind::head) {
            // The beginning of the log is damaged, so it is unknown to which scene these frames belong.
            if (record->header.kind == RecordKind::frame) replayer->missFrames();
            continue;
        }
        if (auto ok = replayer->adoptHead(record->bytes); !ok) return std::unexpected(ok.error());
        replayer->first_ = replayer->head_;
        return replayer;
    }
    return fail("no intact head record", {}, file.string());
}

Result<> Replayer::adoptHead(std::span<const std::byte> record) {
    const auto failed = [this](const Diagnostic& why) { return fail(why.text, {}, log_.file().string()); };
    Result<StreamHead> head = decodeHead(record);
    if (!head) return failed(head.error());
    // Heads are repeated, and one without news changes nothing.
    if (headed_ && head->epoch == head_.epoch && head->dictionaryHash == head_.dictionaryHash &&
        head->formatVersion == head_.formatVersion) {
        if (head->keptFrom && head->epoch == first_.epoch) first_.keptFrom = head->keptFrom;
        return {};
    }
    lost_ = true;
    reported_ = false;
    headed_ = false;
    head_ = std::move(*head);
    if (auto ok = decoder_.setHead(head_); !ok) return failed(ok.error());
    const bool runs = head_.mode.mode == Mode::input;
    decoder_.refuseUnknown(runs);  // where frames are run, nothing may be missing
    if (runs && head_.formatVersion < kFormatVersion)
        return fail(fmt::format("a log in input mode of format {}: only the program that wrote it can run it",
                                head_.formatVersion),
                    {}, log_.file().string());
    if (!runs) {
        runner_.reset();
        scene_->setBehavioursEnabled(false);
    } else if (!runner_) {
        runner_ = std::make_unique<InputReplica>(*scene_, &decoder_);
    }
    headed_ = true;
    return {};
}

/// Notes a frame that does not follow from the scene's state. Counts it once until the next keyframe.
void Replayer::missFrames() {
    lost_ = true;
    if (!std::exchange(reported_, true)) ++gaps_;
}

/// Time never goes back within a session, so such a record is not as it was written.
Result<> Replayer::goesOn(const LogReader::Record& record, double from) {
    if (record.header.time >= from) return {};
    return lose(record.offset, record.header.to,
                fmt::format("its time goes back from {} to {} s", from, record.header.time));
}

/// Returns whether to apply the record, and notes gaps. A keyframe that repeats the present state is not applied.
bool Replayer::leadsOn(const RecordHeader& header) {
    const bool keyframe = header.kind == RecordKind::keyframe;
    if (!keyframe && header.kind != RecordKind::frame) return false;
    if (!headed_) return false;
    if (!lost_) {
        if (header.from == scene_->sequence() && !(keyframe && header.to == 0)) return true;
        if (header.to < scene_->sequence() && !keyframe) ++behind_;
        if (header.to <= scene_->sequence()) return false;
        missFrames();
    }
    if (!keyframe) missFrames();
    return keyframe;
}

Result<> Replayer::lose(std::uint64_t offset, std::uint64_t state, std::string_view why) {
    lost_ = reported_ = true;
    return fail(fmt::format("at byte {}: state {}: {}", offset, state, why), {}, log_.file().string());
}

Result<> Replayer::apply(const LogReader::Record& record) {
    const RecordHeader& header = record.header;
    if (!lost_)
        if (auto ok = goesOn(record, scene_->now()); !ok) return ok;
    if (lost_ && (scene_->sequence() != 0 || frames_ != 0))
        if (auto ok = scene_->reset(); !ok) return ok;
    // Subscribers may still hold the last one.
    if (!set_ || set_.use_count() > 1) set_ = std::make_shared<ChangeSet>();
    Result<> ok = decoder_.decode(record.bytes, *set_);
    set_->input.reset();
    if (decoder_.originHash()) set_->hash = {};  // the scene's own hash counts here
    if (input_ && input_->from == header.from && input_->to == header.to) set_->input = std::move(input_->input);
    if (ok && runner_) {
        if (const Result<bool> taken = runner_->take(set_); !taken) ok = std::unexpected(taken.error());
    } else if (ok) {
        ok = scene_->apply(set_);
    }
    if (!ok) return lose(record.offset, header.to, ok.error().text);
    lost_ = reported_ = false;
    ++frames_;
    noteTime(header);
    if (decoder_.originHash()) set_->hash = scene_->hash();
    check(header, *set_);
    return {};
}

/// Notes that another session follows the one just played.
void Replayer::meetSession() {
    if (closed_ && !head_.start) return;
    ++unclosed_;
    seam_ = goesOn_ ? Seam::goesOn : closed_ ? Seam::beginsBefore : Seam::notClosed;
}

std::optional<LaterPiece> Replayer::laterPiece() {
    if (!first_.start || log_.keyframes().empty()) return std::nullopt;
    const double begins = log_.keyframes().front().time - *first_.start;
    const double letGo = std::clamp(first_.keptFrom.value_or(*first_.start) - *first_.start, 0., std::max(begins, 0.));
    return begins > 0 ? std::optional(LaterPiece{begins, letGo}) : std::nullopt;
}

std::string LaterPiece::format() const {
    if (letGo >= begins) return "what came before was let go";
    if (letGo <= 0) return "what came before is in pieces before it";
    return fmt::format("what came before is in pieces before it, but for the first {} s, which were let go",
                       std::round(letGo * 1e6) / 1e6);
}

/// Returns true if the record led the scene to another state.
Result<bool> Replayer::take(const LogReader::Record& record) {
    if (record.header.kind == RecordKind::head) {
        const std::uint64_t epoch = head_.epoch;
        if (auto ok = adoptHead(record.bytes); !ok) return std::unexpected(ok.error());
        if (head_.epoch != epoch && frames_ > 0) meetSession();
        return false;
    }
    closed_ = saysEnd(record.header);
    goesOn_ = saysGoesOn(record.header);
    if (record.header.kind == RecordKind::input) return takeInput(record);
    if (!leadsOn(record.header)) return false;
    if (auto ok = apply(record); !ok) return std::unexpected(ok.error());
    return true;
}

/// In input mode: runs the frame. Otherwise: keeps the input until the frame's changes come.
Result<bool> Replayer::takeInput(const LogReader::Record& record) {
    const RecordHeader& header = record.header;
    const bool isRunState = header.from == header.to;
    if (headed_ && lost_ && runner_ && !isRunState) missFrames();
    if (!headed_ || lost_ || head_.formatVersion < kFormatVersion ||
        (isRunState ? !runner_ || header.to != scene_->sequence() : header.to <= scene_->sequence()))
        return false;
    if (header.from != scene_->sequence()) {
        if (runner_) missFrames();
        return false;
    }
    auto input = std::make_shared<ChangeSet>();
    if (auto ok = inputDecoder_.decode(record.bytes, *input); !ok) {
        if (!runner_) return false;  // the changes count
        return std::unexpected(lose(record.offset, header.to, ok.error().text).error());
    }
    if (!runner_) {
        input_ = std::move(input);
        return false;
    }
    if (!isRunState && !runner_->exact())
        return std::unexpected(lose(record.offset, header.to, runner_->why()).error());
    const Result<bool> taken = runner_->take(input);
    if (!taken) return std::unexpected(lose(record.offset, header.to, taken.error().text).error());
    if (isRunState) {
        if (!*taken) return std::unexpected(lose(record.offset, header.to, runner_->why()).error());
        return false;
    }
    set_ = std::move(input);
    if (decoder_.originHash()) set_->hash = scene_->hash();
    ++frames_;
    noteTime(header);
    check(header, *set_);
    lost_ = !*taken;
    return true;
}

void Replayer::check(const RecordHeader& header, const ChangeSet& set) {
    const Hash128 hash = decoder_.originHash().value_or(scene_->hash());
    if (hash == header.hash) {
        ++verified_;
        return;
    }
    if (divergence_) return;
    Divergence found{header.to, time_, {}, {}, {}};
    const auto adopt = [&found](std::optional<Divergence> exact, std::string_view seen) {
        if (!exact) return false;
        found.node = std::move(exact->node);
        found.field = std::move(exact->field);
        found.text = fmt::format("{}, seen {}", exact->text, seen);
        return true;
    };
    if (const Change* unheeded = firstUnheeded(*scene_, set)) {
        name(*scene_, *unheeded, found);
        found.text = "the scene does not hold the value that is in the log";
    } else if (runner_) {
        if (!adopt(compareAtNextKeyframe(), "at the next keyframe"))
            found.text = "run again from its input, the frame comes out otherwise";
        if (const std::string lacking = decoder_.lackingHere(); !lacking.empty())
            found.text += fmt::format("; it was written by a program with {}, which this one lacks", lacking);
    } else if (!adopt(compareWithRerun(header, set), "by running the frame again from its input") &&
               !adopt(compareAtNextKeyframe(), "at the next keyframe") && !set.changes.empty()) {
        const auto first = std::ranges::find_if(set.changes, [](const Change& c) {
            return c.kind != ChangeKind::defineType && c.kind != ChangeKind::event;
        });
        if (first != set.changes.end()) name(*scene_, *first, found);
        found.text = set.changes.size() == 1
                         ? "the value in the log is not the one that the origin had"
                         : fmt::format(
                               "one of the {} changes of this state, this is the first: nothing in the log "
                               "tells which",
                               set.changes.size());
    }
    found.text += fmt::format(" (hash {}, recorded {})", hash.hex(), header.hash.hex());
    divergence_ = std::move(found);
}

/// Runs the frame again from its input, in a scene in the state before. If that leads to the recorded hash, the result
/// is what the origin had, and is compared.
std::optional<Divergence> Replayer::compareWithRerun(const RecordHeader& header, const ChangeSet& set) const {
    if (header.kind != RecordKind::frame || header.to != header.from + 1 || divergence_) return std::nullopt;
    Result<std::unique_ptr<Replayer>> before = open(log_.file());
    if (!before) return std::nullopt;
    Replayer& other = **before;
    for (const LogKeyframe& keyframe : other.log_.keyframes())
        if (keyframe.offset < log_.position() && keyframe.to <= header.from) other.log_.seek(keyframe.head);
    other.headed_ = false;
    while (other.lost_ || other.scene_->sequence() < header.from) {
        const Result<bool> more = other.step();
        if (!more || !*more || other.divergence_) return std::nullopt;
    }
    Scene& truth = other.scene();
    truth.setBehavioursEnabled(true);
    if (!InputPlayer(truth).run(set) || truth.hash() != header.hash) return std::nullopt;
    return firstDifference(truth, *scene_, {"the origin had", "the log has"});
}

/// Steps a copy of the scene on to the log's next whole state and compares both.
std::optional<Divergence> Replayer::compareAtNextKeyframe() const {
    Result<LogReader> ahead = LogReader::open(log_.file());
    if (!ahead) return std::nullopt;
    ahead->seek(log_.position());
    ChangeDecoder decoder(builtinTypes(), decoder_.localHash());
    if (!decoder.setHead(head_) || !decoder.exact()) return std::nullopt;
    decoder.goOnFrom(decoder_);
    Scene suspect, truth;
    suspect.setBehavioursEnabled(false);
    truth.setBehavioursEnabled(false);
    if (!suspect.apply(std::make_shared<const ChangeSet>(scene_->snapshot()))) return std::nullopt;
    while (const std::optional<LogReader::Record> record = ahead->next()) {
        if (record->header.kind == RecordKind::head) {
            const Result<StreamHead> head = decodeHead(record->bytes);
            if (!head || head->epoch != head_.epoch) return std::nullopt;
        }
        if (record->header.kind != RecordKind::frame && record->header.kind != RecordKind::keyframe) continue;
        const auto set = std::make_shared<ChangeSet>();
        if (!decoder.decode(record->bytes, *set)) return std::nullopt;
        if (record->header.kind == RecordKind::frame) {
            if (!suspect.apply(set)) return std::nullopt;
            continue;
        }
        if (record->header.to != suspect.sequence() || !truth.apply(set)) return std::nullopt;
        return firstDifference(truth, suspect, {"the origin had", "the log leads to"});
    }
    return std::nullopt;
}

Result<bool> Replayer::step() {
    while (const std::optional<LogReader::Record> record = log_.next()) {
        const Result<bool> moved = take(*record);
        if (!moved || *moved) return moved;
    }
    return false;
}

std::optional<double> Replayer::nextTime() {
    const std::uint64_t here = log_.position();
    std::optional<double> time;
    while (!time) {
        const std::optional<LogReader::Record> record = log_.next();
        if (!record) break;
        const RecordHeader& header = record->header;
        const bool leads = header.kind == RecordKind::frame || header.kind == RecordKind::keyframe ||
                           (header.kind == RecordKind::input && header.from != header.to);
        if (leads && header.to != scene_->sequence()) time = header.time;
    }
    log_.seek(here);
    return time;
}

std::optional<std::pair<std::uint64_t, std::uint64_t>> Replayer::missingNext() {
    const std::uint64_t here = log_.position(), state = scene_->sequence();
    std::optional<std::pair<std::uint64_t, std::uint64_t>> missing;
    while (const std::optional<LogReader::Record> record = log_.next()) {
        const RecordHeader& header = record->header;
        if (header.kind == RecordKind::head) {
            const auto head = decodeHead(record->bytes);
            if (!head || head->epoch != head_.epoch) break;
        } else if (header.kind != RecordKind::index && header.to > state) {
            // A frame leads on from a state. A keyframe is one by itself: of what led there nothing is known.
            const bool leads = header.kind != RecordKind::keyframe;
            const std::uint64_t last = leads ? header.from : header.to;
            if (last > state + (leads ? 0 : 1)) missing.emplace(state + 1, last);
            break;
        }
    }
    log_.seek(here);
    return missing;
}

/// Brings the scene to a keyframe's state. Returns false if the keyframe or the head before it is damaged.
bool Replayer::startAt(const LogKeyframe& keyframe) {
    const auto recordAt = [this](std::uint64_t offset, RecordKind kind) {
        log_.seek(offset);
        std::optional<LogReader::Record> record = log_.next();
        if (record && (record->offset != offset || record->header.kind != kind)) record.reset();
        return record;
    };
    const auto head = recordAt(keyframe.head, RecordKind::head);
    if (!head || !adoptHead(head->bytes)) return false;
    const auto record = recordAt(keyframe.offset, RecordKind::keyframe);
    lost_ = true;
    shift_ = shiftAt(keyframe.offset);
    time_ = -std::numeric_limits<double>::infinity();
    return record && record->header.to == keyframe.to && apply(*record);
}

/// The value of time() in the state to which the record leads.
double Replayer::timeOf(const RecordHeader& header) const {
    const double time = header.time + shift_;
    return lost_ ? std::max(time, time_) : time;
}

void Replayer::noteTime(const RecordHeader& header) {
    const double time = header.time + shift_;
    if (time < time_) shift_ += time_ - time;
    time_ = header.time + shift_;
}

double Replayer::shiftAt(std::uint64_t offset) const {
    double shift = 0;
    for (const Cycle& rotation : *cycles_)
        if (rotation.offset <= offset) shift = rotation.shift;
    return shift;
}

/// Finds where sessions begin earlier than the last one ended. Time never goes back within a session, so nothing needs
/// to be read if the first and the last keyframe are of one session.
void Replayer::findCycles() {
    if (cycles_) return;
    cycles_.emplace();
    const std::uint64_t from = log_.keyframes().front().head, to = log_.keyframes().back().head;
    Result<LogReader> log = from == to ? fail("") : LogReader::open(log_.file());
    if (!log) return;
    const auto epochAt = [&](std::uint64_t offset) -> std::optional<std::uint64_t> {
        log->seek(offset);
        const auto record = log->next();
        if (!record || record->offset != offset) return std::nullopt;
        const auto head = decodeHead(record->bytes);
        return head ? std::optional(head->epoch) : std::nullopt;
    };
    if (const auto first = epochAt(from); first && first == epochAt(to)) return;
    log->seek(0);
    double last = -std::numeric_limits<double>::infinity(), shift = 0;
    std::uint64_t epoch = 0, beginsAt = 0;
    bool begins = false;  // a session has begun and has no state yet
    while (const std::optional<LogReader::Record> record = log->next()) {
        const RecordHeader& header = record->header;
        if (header.kind == RecordKind::head) {
            const auto head = decodeHead(record->bytes);
            if (!head || std::exchange(epoch, head->epoch) == head->epoch) continue;
            begins = true;
            beginsAt = record->offset;
        } else if (header.kind != RecordKind::index) {
            if (begins && header.time + shift < last) {
                shift = last - header.time;
                cycles_->push_back({beginsAt, shift});
            }
            begins = false;
            last = std::max(last, header.time + shift);
        }
    }
}

/// Goes on to the last state that is not after `time`. Frames between two heads become one set.
Result<> Replayer::composeUntil(double time) {
    ChangeComposer composer;
    ChangeSet set;
    std::optional<RecordHeader> last;  // the last record in the composer
    const auto flush = [&]() -> Result<> {
        if (!last) return {};
        auto merged = std::make_shared<ChangeSet>(composer.take(scene_.get()));
        set_ = merged;
        if (decoder_.originHash()) merged->hash = {};
        if (auto ok = scene_->apply(merged); !ok) return lose(log_.position(), last->to, ok.error().text);
        ++frames_;
        noteTime(*last);
        if (decoder_.originHash()) merged->hash = scene_->hash();
        check(*last, *merged);
        last.reset();
        return {};
    };
    while (const std::optional<LogReader::Record> record = log_.next()) {
        const RecordHeader& header = record->header;
        const bool frame = header.kind == RecordKind::frame;
        if (header.kind == RecordKind::head) {
            if (auto ok = flush(); !ok) return ok;
            if (auto ok = adoptHead(record->bytes); !ok) return ok;
        } else if (header.kind == RecordKind::input && runner_) {
            if (header.from != header.to && timeOf(header) > time) {
                log_.seek(record->offset);
                break;
            }
            if (auto ok = flush(); !ok) return ok;
            if (auto ran = takeInput(*record); !ran) return std::unexpected(ran.error());
        } else if (!frame && header.kind != RecordKind::keyframe) {
            continue;
        } else if (timeOf(header) > time) {
            log_.seek(record->offset);
            break;
        } else if (frame && !lost_ && header.from == (last ? last->to : scene_->sequence())) {
            if (auto ok = goesOn(*record, last ? last->time : scene_->now()); !ok) return ok;
            if (auto ok = decoder_.decode(record->bytes, set); !ok)
                return lose(record->offset, header.to, ok.error().text);
            composer.add(set);
            last = header;
        } else {
            if (auto ok = flush(); !ok) return ok;
            if (leadsOn(header))
                if (auto ok = apply(*record); !ok) return ok;
        }
    }
    return flush();
}

Result<> Replayer::seek(double time) {
    const std::vector<LogKeyframe>& keyframes = log_.keyframes();
    if (keyframes.empty()) return fail("no keyframe to start from", {}, log_.file().string());
    findCycles();
    std::size_t best = 0;
    for (std::size_t i = 0; i < keyframes.size(); ++i)
        if (keyframes[i].time + shiftAt(keyframes[i].offset) <= time) best = i;
    const bool ahead = !lost_ && time_ <= time && keyframes[best].offset < log_.position();
    if (!ahead) {
        // If a keyframe is damaged, starts from an earlier one; before the first there is none.
        std::size_t tried = best + 1;
        while (tried > 0 && !startAt(keyframes[tried - 1])) --tried;
        for (std::size_t i = best + 1; tried == 0 && i < keyframes.size(); ++i)
            if (startAt(keyframes[i])) tried = i + 1;
        if (tried == 0) return fail("no intact keyframe to start from", {}, log_.file().string());
    }
    return composeUntil(time);
}

std::string ComparedStates::format() const {
    return one == 0 ? "in every state"
                    : fmt::format("in all states that both hold ({}); {} more are in one of them", both, one);
}

namespace {

/// One of two logs that are compared.
class ComparedLog {
  public:
    explicit ComparedLog(Replayer& replayer) : replayer_(replayer) {}

    Result<> step() {
        const std::uint64_t gaps = replayer_.gaps(), epoch = replayer_.head().epoch, frames = replayer_.frames();
        const Result<bool> more = replayer_.step();
        if (!more) return std::unexpected(more.error());
        more_ = *more;
        const bool another = frames > 0 && replayer_.head().epoch != epoch;
        jumped_ = another || (frames > 0 && replayer_.gaps() > gaps);
        session_ += another;
        return {};
    }
    /// The number of the session, from 1.
    std::uint64_t session() const { return session_; }
    bool more() const { return more_; }
    const Scene& scene() const { return replayer_.scene(); }
    std::uint64_t state() const { return scene().sequence(); }
    const Replayer& replayer() const { return replayer_; }
    std::string name() const { return replayer_.log().file().string(); }
    /// True if the last step passed a hole, so that this log lacks states that only the other one has. Merged frames
    /// and a late beginning are not holes.
    bool jumped() const { return jumped_; }

  private:
    Replayer& replayer_;
    bool more_ = true, jumped_ = false;
    std::uint64_t session_ = 1;
};

/// State numbers begin anew with each session. Adds the session to the text, unless it is the first of both logs.
Divergence inSessions(Divergence found, const ComparedLog& x, const ComparedLog& y) {
    if (x.session() == y.session() && x.session() > 1)
        found.text += fmt::format(", in session {} of both", x.session());
    else if (x.session() != y.session())
        found.text +=
            fmt::format(", in session {} of {} and session {} of {}", x.session(), x.name(), y.session(), y.name());
    return found;
}

std::optional<Divergence> differenceOfStates(const Scene& s, const Scene& t) {
    if (s.hash() != t.hash()) {
        if (auto difference = firstDifference(s, t)) return difference;
        return Divergence{s.sequence(), s.now(), {}, {}, "other hash"};
    }
    if (s.now() != t.now())
        return Divergence{s.sequence(),
                          s.now(),
                          {},
                          "time",
                          fmt::format("second is {:.9g} s {} than first", std::abs(t.now() - s.now()),
                                      t.now() > s.now() ? "later" : "earlier")};
    return std::nullopt;
}

/// Notes holes and wrong order in logs whose common states agree.
class HolesOfLogs {
  public:
    /// `ahead` has passed the state that `behind` is in.
    void pass(const ComparedLog& behind, const ComparedLog& ahead) {
        if (!first_ && ahead.jumped())
            first_ = inSessions({behind.state(), behind.scene().now(), {}, {}, ahead.name() + " lacks this state"},
                                behind, ahead);
    }
    void end(const ComparedLog& log) {
        if (!first_ && log.replayer().framesBehind() > 0)
            first_ = Divergence{log.state(),
                                log.scene().now(),
                                {},
                                {},
                                fmt::format("the pieces of {} are in another order than they were written in: {} "
                                            "frames were not compared",
                                            log.name(), log.replayer().framesBehind())};
    }
    const std::optional<Divergence>& first() const { return first_; }

  private:
    std::optional<Divergence> first_;
};

Result<std::optional<Divergence>> compareStates(ComparedLog& x, ComparedLog& y,
                                                const std::function<void(std::uint64_t, std::uint64_t)>& progress,
                                                ComparedStates& states) {
    HolesOfLogs holes;
    for (ComparedLog* log : {&x, &y})
        if (auto ok = log->step(); !ok) return std::unexpected(ok.error());
    while (x.more() && y.more()) {
        if (progress) progress(x.replayer().log().position(), x.replayer().log().size());
        const bool both = x.state() == y.state();
        ++(both ? states.both : states.one);
        if (both) {
            if (auto difference = differenceOfStates(x.scene(), y.scene()))
                return holes.first() ? holes.first() : inSessions(std::move(*difference), x, y);
        } else {
            x.state() < y.state() ? holes.pass(x, y) : holes.pass(y, x);
        }
        const bool stepX = x.state() <= y.state(), stepY = both || !stepX;
        if (stepX)
            if (auto ok = x.step(); !ok) return std::unexpected(ok.error());
        if (stepY)
            if (auto ok = y.step(); !ok) return std::unexpected(ok.error());
    }
    ComparedLog &longer = x.more() ? x : y, &shorter = x.more() ? y : x;
    const bool unequal = longer.more();
    const Divergence end = inSessions({longer.state(),
                                       longer.scene().now(),
                                       {},
                                       {},
                                       fmt::format("{} ends before {} does", shorter.name(), longer.name())},
                                      x, y);
    for (; longer.more(); ++states.one)
        if (auto ok = longer.step(); !ok) return std::unexpected(ok.error());
    if (states.both == 0) return Divergence{0, 0, {}, {}, "no state is in both logs"};
    holes.end(x);
    holes.end(y);
    if (holes.first()) return holes.first();
    return unequal ? std::optional(end) : std::nullopt;
}

}  // namespace

Result<std::optional<Divergence>> diffLogs(const std::filesystem::path& a, const std::filesystem::path& b,
                                           const std::function<void(std::uint64_t, std::uint64_t)>& progress,
                                           ComparedStates* compared) {
    Result<std::unique_ptr<Replayer>> opened[] = {Replayer::open(a), Replayer::open(b)};
    for (const auto& log : opened)
        if (!log) return std::unexpected(log.error());
    ComparedLog x(**opened[0]), y(**opened[1]);
    ComparedStates states;
    auto result = compareStates(x, y, progress, states);
    for (std::size_t i = 0; i < 2; ++i) states.damage[i] = (*opened[i])->log().damageText();
    if (compared) *compared = states;
    return result;
}

}  // namespace rtsg
