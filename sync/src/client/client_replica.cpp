// The replica of a mirror's client: applies records in order and in time, compares hashes, names and repairs
// differences, and makes requests.
#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/frame_input.h>

#include "client_impl.h"
#include "codec/node_label.h"
#include "edits/request.h"
#include "edits/upstream.h"

namespace rtsg {

using namespace std::chrono_literals;
using mirror::Bisection;
using mirror::Message;

namespace {

constexpr auto kRepairAgain = 1000ms;      // between two snapshots that a divergence asks for
constexpr unsigned kScrubBits = 12;        // nodes compared at once, as a power of two
constexpr std::size_t kMaxAnnounced = 20;  // differences of one divergence that are reported

}  // namespace

// ---- records in their turn and time ------------------------------------------------------------------------------

void MirrorClient::Impl::arrived(std::span<const std::byte> bytes, bool isRecord, std::uint64_t published) {
    const std::uint64_t now = time_.nanoseconds();
    if (published != 0) clock_.arrival(published, now);
    statistics_.jitter = clock_.jitter();
    if (options_.latency.count() == 0) {
        if (published != 0) shownAt_ = published;
        return take(bytes, isRecord);
    }
    MirrorPlayout::Item item;
    item.bytes.assign(bytes.begin(), bytes.end());
    item.isRecord = isRecord;
    item.published = published;
    const bool first = !haveState_ && playout_.empty();  // until the first state there is nothing to show
    if (published != 0 && clock_.known() && !first) {
        item.due = clock_.here(published) + static_cast<std::uint64_t>(options_.latency.count()) * 1000000;
        // There is no use in waiting for frames from before this client came, or with a longer delay than asked for.
        if (item.due < now) {
            if (haveState_) ++statistics_.late;
            item.due = 0;
        }
        item.due = std::min(item.due, now + static_cast<std::uint64_t>(options_.latency.count()) * 1000000);
    }
    playout_.push(std::move(item));
}

void MirrorClient::Impl::playDue() {
    while (!playout_.empty() && (playout_.front().due <= time_.nanoseconds() || playout_.bytes() > options_.window)) {
        const MirrorPlayout::Item item = playout_.pop();
        if (item.published != 0) shownAt_ = item.published;
        take(item.bytes, item.isRecord);
    }
}

std::chrono::milliseconds MirrorClient::Impl::untilDue(std::chrono::milliseconds maximum) const {
    if (playout_.empty()) return maximum;
    const std::uint64_t now = time_.nanoseconds(), due = playout_.front().due;
    if (due <= now) return 0ms;
    return std::min(maximum, std::chrono::ceil<std::chrono::milliseconds>(std::chrono::nanoseconds(due - now)));
}

Value MirrorClient::Impl::presented(NodeId node, FieldIndex field) const {
    const Node* found = replica_.find(node);
    if (!found || field >= found->type().fieldCount() || !found->type().fields[field].readable()) return {};
    Value value = found->value(field);
    if (playout_.empty() || !decoder_.exact() || !clock_.known()) return value;
    const Value* next = playout_.next(decoder_, node, field);
    const std::uint64_t from = shownAt_, to = playout_.front().published;
    if (!next || from == 0 || to <= from) return value;
    const double shown = static_cast<double>(time_.nanoseconds()) -
                         static_cast<double>(options_.latency.count()) * 1e6 - static_cast<double>(clock_.here(from));
    return interpolate(value, *next, shown / static_cast<double>(to - from));
}

void MirrorClient::Impl::take(std::span<const std::byte> bytes, bool isRecord) {
    if (isRecord) return record(bytes);
    answer(bytes);
}

/// Notices and reports, before the next frame, if the replica's owner has edited it.
bool MirrorClient::Impl::editedByItsOwner() {
    if (!haveState_) return false;
    const std::shared_ptr<const ChangeSet> edits = replica_.seal();
    if (!edits && replica_.sequence() == state_) return false;
    ++statistics_.divergences;
    statistics_.equal = false;
    if (edits)
        for (std::size_t i = 0; i < std::min(edits->changes.size(), kMaxAnnounced); ++i) {
            const Change& c = edits->changes[i];
            const Node* node = replica_.find(c.node);
            const bool hasField = node && c.field < node->type().fields.size();
            announce({state_, replica_.now(), nodeLabel(replica_, c.node),
                      hasField ? node->type().fields[c.field].name : "", "edited here"});
        }
    else
        report(Severity::error, fmt::format("state {}: the replica was edited here", state_));
    hello(true);
    return true;
}

void MirrorClient::Impl::record(std::span<const std::byte> bytes) {
    const Result<RecordHeader> header = checkRecord(bytes, 0, options_.maxRecord);
    if (!header) {
        garbage("a damaged record: " + header.error().text);
        return hello(false);
    }
    if (header->kind == RecordKind::input) return input(bytes, *header);
    if (header->kind != RecordKind::frame && header->kind != RecordKind::keyframe) return;
    running_ = false;
    if (editedByItsOwner()) return;
    newestHeard_ = std::max(newestHeard_, header->to);
    const bool follows = haveState_ && header->from == state_;
    if (follows && header->from == header->to && header->from != 0) return repair(bytes, *header);
    if (!follows && haveState_ && header->kind == RecordKind::frame) {
        if (header->to <= state_) return;  // applied already
        ++statistics_.gaps;
        report(Severity::note, fmt::format("frames {} to {} are missing", state_ + 1, header->from));
        return hello(false);
    }
    if (!follows && header->kind == RecordKind::frame) {
        ++statistics_.gaps;
        return hello(true);
    }
    if (!follows && touched_) {
        if (auto ok = replica_.reset(); !ok) {
            refusal_ = ok.error().text;
            return;
        }
        newestHeard_ = header->to;
    }
    apply(bytes, *header, !follows);
}

std::shared_ptr<ChangeSet> MirrorClient::Impl::freshSet() {
    for (const auto& set : sets_)
        if (set.use_count() == 1) return set;
    if (sets_.size() >= 8) sets_.erase(sets_.begin());
    return sets_.emplace_back(std::make_shared<ChangeSet>());
}

/// Returns true if the frame changes the same fields as the last one, and nobody wants to see the set. Most frames of a
/// scene in motion are like that.
bool MirrorClient::Impl::applyAgain(std::span<const std::byte> bytes, const RecordHeader& header) {
    if (!decoder_.exact()) return false;
    const auto columns = repeated_.match(bytes, header);
    if (!columns || !replica_.applyAgain(header.to, header.time, *columns)) return false;
    lastChanges_ = 0;
    for (const PlainColumn& column : *columns) lastChanges_ += column.count;
    return true;
}

Result<std::shared_ptr<ChangeSet>> MirrorClient::Impl::applySet(std::span<const std::byte> bytes,
                                                                const RecordHeader& header) {
    // The memory of a snapshot is not kept for frames.
    std::shared_ptr<ChangeSet> set = header.kind == RecordKind::keyframe ? std::make_shared<ChangeSet>() : freshSet();
    repeated_.forget();
    Result<> ok = decoder_.decode(bytes, *set);
    touched_ = true;
    lastChanges_ = set->changes.size();
    if (ok) ok = replica_.apply(set);
    if (!ok) return std::unexpected(ok.error());
    repeated_.remember(bytes, header);
    return set;
}

/// Others can use the record itself if its values are complete and its field numbers are ours.
void MirrorClient::Impl::reportStep(std::span<const std::byte> bytes, const RecordHeader& header,
                                    std::shared_ptr<ChangeSet> set) {
    if (!onStep_) return;
    RecordStep step;
    if (!set || (decoder_.exact() && header.kind == RecordKind::frame && header.flags == 0)) {
        const auto record = std::make_shared<EncodedRecord>();
        record->bytes.append(bytes);
        record->header = header;
        step.record = record;
    }
    if (set && set->hash != replica_.hash() && !decoder_.exact()) {
        set = std::make_shared<ChangeSet>(*set);
        set->hash = replica_.hash();
    }
    step.set = std::move(set);
    onStep_(step);
}

/// The origin was out of reach. The next record tells whether it went on without us meanwhile.
void MirrorClient::Impl::noteHole(const RecordHeader& header, bool afresh) {
    constexpr double kMerged = 1;  // in seconds; shorter merges are normal on slow links
    const std::optional<Clock::time_point> lost = std::exchange(lostAt_, std::nullopt);
    if (!lost || heldEpoch_ == 0) return;
    const bool everyFrame = options_.framesPerSecond == 0 && options_.maxLag.count() == 0;
    const bool isMerged = everyFrame && header.to > header.from + 1 && header.time - replica_.now() > kMerged;
    const bool isOther = heldEpoch_ != epoch_;
    if (afresh ? !isOther && header.to <= state_ + 1 : !isMerged) return;
    const double seconds = std::chrono::duration<double>(time_.now() - *lost).count();
    ++statistics_.holes;
    statistics_.missed += seconds;
    report(Severity::warning,
           fmt::format("{:.2f} s of the session were missed: state {} was the last before them, {} {} is the next",
                       seconds, state_, isOther ? "another run's state" : "state", header.to));
    if (options_.onMissed) options_.onMissed();
}

void MirrorClient::Impl::apply(std::span<const std::byte> bytes, const RecordHeader& header, bool afresh) {
    noteHole(header, afresh);
    Result<std::shared_ptr<ChangeSet>> set;
    if (afresh || !applyAgain(bytes, header)) set = applySet(bytes, header);
    if (!set) {
        garbage(fmt::format("state {}, which cannot be applied: {}", header.to, set.error().text));
        haveState_ = false;
        if (time_.now() - repaired_ > kRepairAgain) {
            repaired_ = time_.now();
            hello(true);
        } else {
            connected_ = false;
            greeted_ = time_.now();
        }
        return;
    }
    haveState_ = true;
    heldEpoch_ = epoch_;
    ++applied_;
    ++statistics_.frames;
    if (afresh) {
        ++statistics_.snapshots;
        diverged_ = false;
    }
    state_ = statistics_.sequence = header.to;
    stateHash_ = header.hash;
    if (!afresh) noteLag();
    reportStep(bytes, header, std::move(*set));
    compare(header);
}

/// Notes the age of the frame that was just applied, as exactly as the clocks' offset is known.
void MirrorClient::Impl::noteLag() {
    if (shownAt_ == 0 || !clock_.known()) return;
    statistics_.lag =
        std::max(0., (static_cast<double>(time_.nanoseconds()) - static_cast<double>(clock_.here(shownAt_))) * 1e-9);
    statistics_.maximumLag = std::max(statistics_.maximumLag, statistics_.lag);
}

/// Takes the input of a frame, which is run here, or a run state from which inputs can be run.
void MirrorClient::Impl::input(std::span<const std::byte> bytes, const RecordHeader& header) {
    if (editedByItsOwner()) return;
    const bool isRunState = header.from == header.to;
    newestHeard_ = std::max(newestHeard_, header.to);
    if (!haveState_ || (!isRunState && header.to <= state_)) return;
    if (header.from != state_) {
        if (isRunState) return;
        ++statistics_.gaps;
        return hello(false);
    }
    if (!decoder_.exact()) return garbage("an input for other node types than ours");
    const std::shared_ptr<ChangeSet> set = freshSet();
    if (auto ok = inputDecoder_.decode(bytes, *set); !ok) {
        garbage("an input that makes no sense: " + ok.error().text);
        return hello(false);
    }
    if (isRunState) {
        if (diverged_ || replica_.hash() != header.hash) return;
        replica_.setBehavioursEnabled(true);
        if (auto ok = replica_.resumeFrom(*set->input->runState); !ok) return stopRunning(ok.error().text);
        running_ = true;
        return;
    }
    if (!running_) return hello(false);
    repeated_.forget();
    const auto ran = replica_.runInput(*set->input, header.time);
    touched_ = true;
    if (!ran) return stopRunning(ran.error().text);
    state_ = statistics_.sequence = header.to;
    stateHash_ = header.hash;
    ++applied_;
    ++statistics_.frames;
    ++statistics_.inputs;
    if (onStep_) onStep_({nullptr, *ran});
    if (replica_.hash() == header.hash) return compare(header);
    ++statistics_.divergences;
    statistics_.equal = false;
    stopRunning(fmt::format("hash {} here, {} at the origin", replica_.hash().hex(), header.hash.hex()));
}

/// Asks for a state of the origin. After a few such troubles it asks for changes instead of inputs.
void MirrorClient::Impl::stopRunning(const std::string& why) {
    ++inputTroubles_;
    report(Severity::warning, fmt::format("state {}, run here from its input: {}{}", state_, why,
                                          inputTroubles_ < kMaxInputTroubles ? "" : "; changes are taken from now on"));
    hello(true);
}

// ---- hashes compared, differences named and repaired -------------------------------------------------------------

void MirrorClient::Impl::compare(const RecordHeader& header) {
    statistics_.hash = replica_.hash();
    statistics_.originHash = header.hash;
    statistics_.equal = statistics_.hash == statistics_.originHash;
    if (statistics_.equal || !decoder_.exact()) {
        // A difference that only the memory shows, and not the running hash, counts until it is repaired.
        if (statistics_.equal && diverged_ && !bisection_.running()) diverged_ = false;
        return;
    }
    if (diverged_) return;
    diverged_ = true;
    ++statistics_.divergences;
    report(Severity::error, fmt::format("state {}: hash {} here, {} at the origin", header.to, statistics_.hash.hex(),
                                        statistics_.originHash.hex()));
    if (!bisection_.running()) doubt({});
}

void MirrorClient::Impl::announce(const Divergence& d) {
    report(Severity::error,
           fmt::format("state {}: {}{}{}: {}", d.frame, d.node, d.field.empty() ? "" : ".", d.field, d.text));
    if (options_.onDivergence) options_.onDivergence(d);
}

void MirrorClient::Impl::doubt(std::vector<mirror::NodeRange> ranges) {
    bisection_.begin(session_, std::move(ranges), message_);
    asked_ = time_.now();
    ++statistics_.questions;
    send();
}

void MirrorClient::Impl::scrub(Clock::time_point now) {
    if (options_.scrub.count() == 0 || !haveState_ || diverged_ || bisection_.running() || !decoder_.exact()) return;
    if (scrubbed_ == Clock::time_point{}) scrubbed_ = now;
    if (now - scrubbed_ < options_.scrub || !partial_.empty()) return;
    scrubbed_ = now;
    const mirror::NodeRange whole = mirror::wholeRange(replica_);
    if (whole.bits <= kScrubBits) return doubt({});
    if (scrubAt_ >> whole.bits) scrubAt_ = 0;
    doubt({mirror::NodeRange{scrubAt_, kScrubBits}});
    scrubAt_ += std::uint32_t{1} << kScrubBits;
}

void MirrorClient::Impl::giveUpRepair(const std::string& why) {
    bisection_.stop();
    report(Severity::note, fmt::format("state {}: {}: a snapshot instead of a repair", state_, why));
    if (time_.now() - repaired_ < kRepairAgain) return doubt({});  // not too soon after the last one
    repaired_ = time_.now();
    hello(true);
}

/// Takes answers to questions and requests, in their order among the records.
void MirrorClient::Impl::answer(std::span<const std::byte> message) {
    wire::Reader in(message);
    const std::optional<Message> type = mirror::readPrologue(in);
    if (in.number<std::uint64_t>() != session_) return;
    if (type == Message::verdict) {
        mirror::Verdict verdict;
        if (!verdict.read(in)) return garbage("a malformed verdict");
        const auto request = std::ranges::find(requests_, verdict.request, &Request::number);
        if (request == requests_.end()) return;
        requests_.erase(request);
        MirrorVerdict result{verdict.request, verdict.refusal, verdict.state, {}, verdict.kept};
        for (const auto& [provisional, number] : verdict.created)
            result.created.emplace_back(NodeId{provisional}, NodeId{number});
        verdicts_.push_back(std::move(result));
        return;
    }
    const auto state = in.number<std::uint64_t>();
    if (!bisection_.running() || !haveState_ || state != state_ || editedByItsOwner()) return;
    const Bisection::Step step = type == Message::digest ? bisection_.digest(replica_, in, message_)
                                                         : bisection_.anatomy(replica_, in, message_);
    if (step != Bisection::Step::same && step != Bisection::Step::malformed && !diverged_) {
        // A scrub found it; the running hash does not show it.
        diverged_ = true;
        statistics_.equal = false;
        ++statistics_.divergences;
        report(Severity::error, fmt::format("state {}: other memory than the origin's", state_));
    }
    if (type == Message::anatomy)
        for (std::size_t i = 0; i < std::min(bisection_.found().size(), kMaxAnnounced); ++i)
            announce(bisection_.found()[i]);
    switch (step) {
        case Bisection::Step::ask:
            asked_ = time_.now();
            ++statistics_.questions;
            send();
            return;
        case Bisection::Step::same:
            return nothingDiffers();
        case Bisection::Step::hopeless:
            return giveUpRepair("too much differs");
        case Bisection::Step::malformed:
            garbage("an answer that makes no sense");
            if (diverged_) giveUpRepair("no answer that makes sense");
            bisection_.stop();
            return;
    }
}

/// The stored values are the origin's. If the running hash is not, a value was changed behind it and has been
/// overwritten since.
void MirrorClient::Impl::nothingDiffers() {
    bisection_.stop();
    if (!diverged_) return;
    const auto set = std::make_shared<ChangeSet>();
    set->from = set->to = state_;
    set->time = replica_.now();
    set->hash = statistics_.originHash;
    repeated_.forget();
    if (auto ok = replica_.apply(set); !ok) return giveUpRepair(ok.error().text);  // computes the hash anew
    statistics_.hash = replica_.hash();
    if (statistics_.hash != statistics_.originHash) return giveUpRepair("the state hash stays wrong");
    announce(
        {state_, replica_.now(), "", "",
         fmt::format("a value had been changed behind the replica's back; a frame has written it since, of {} that "
                     "the frame before this wrote",
                     lastChanges_)});
    healed();
}

void MirrorClient::Impl::healed() {
    diverged_ = false;
    statistics_.equal = true;
    ++statistics_.repairs;
    report(Severity::note, fmt::format("state {}: repaired after {} questions", state_, bisection_.questions()));
}

void MirrorClient::Impl::repair(std::span<const std::byte> bytes, const RecordHeader& header) {
    if (!bisection_.running()) return;
    const std::shared_ptr<ChangeSet> set = freshSet();
    repeated_.forget();
    Result<> ok = decoder_.decode(bytes, *set);
    if (ok) {
        bisection_.complete(replica_, *set);
        ok = replica_.apply(set);
    }
    bisection_.stop();
    if (!ok) {
        report(Severity::note, "a repair that cannot be applied: " + ok.error().text);
        haveState_ = false;
        return hello(true);
    }
    statistics_.hash = replica_.hash();
    statistics_.originHash = header.hash;
    if (statistics_.hash == header.hash) return healed();
    giveUpRepair("the repair did not suffice");
}

// ---- upstream ----------------------------------------------------------------------------------------------------

Result<std::uint64_t> MirrorClient::Impl::submit(MirrorRequest asked) {
    if (asked.author.size() > mirror::kLongestName) return fail("an author's name of over 200 bytes");
    if (asked.nodes.size() > MirrorRequest::kMaxLocked)
        return fail(
            fmt::format("{} nodes are locked at once, the most is {}", asked.nodes.size(), MirrorRequest::kMaxLocked));
    if (asked.lease < std::chrono::milliseconds(0) || asked.lease > MirrorRequest::kLongestLease)
        return fail(
            fmt::format("a lease of {} ms, the most is {}", asked.lease.count(), MirrorRequest::kLongestLease.count()));
    Request request;
    request.author = asked.author;
    request.types = originTypes_;
    const std::uint64_t state = std::max<std::uint64_t>(1, state_);
    if (decoder_.exact()) {
        mirror::writeRequest(encoder_, std::move(asked), state, request.record);
    } else {
        if (auto ok = toOriginsNumbers(asked.changes); !ok) return std::unexpected(ok.error());
        ChangeEncoder describing;  // each request is decoded on its own
        mirror::writeRequest(describing, std::move(asked), state, request.record);
    }
    if (request.record.size() > mirror::kLongestSubmission)
        return fail(
            fmt::format("a request of {} bytes, the most is {}", request.record.size(), mirror::kLongestSubmission));
    request.number = nextRequest_++;
    const std::uint64_t number = request.number;
    requests_.push_back(std::move(request));
    if (!decoder_.exact() && std::exchange(dictionaryHash_, 0) != 0)
        hello(false);  // tells the server that types must be described
    if (connected_) sendRequests();
    return number;
}

/// Fields of existing nodes get the origin's numbers. Fields of nodes that the request creates are found by name,
/// because the request describes their types.
Result<> MirrorClient::Impl::toOriginsNumbers(std::vector<Change>& changes) const {
    const auto map = [&](NodeId node, FieldIndex& field) -> Result<> {
        if (node.value >= mirror::kFirstProvisional || field == kNoField) return {};
        const FieldIndex ours = std::exchange(field, decoder_.fieldAtWriter(node, field));
        if (field != kNoField) return {};
        const Node* here = replica_.find(node);
        if (!here || ours >= here->type().fields.size())
            return fail(fmt::format("node {} has no such field", node.value));
        return fail(fmt::format("{} has no field '{}' at the origin, which is of another version", here->type().name,
                                here->type().fields[ours].name));
    };
    for (Change& change : changes) {
        Result<> ok;
        if (change.kind == ChangeKind::createNode) {
            if (change.index >= builtinTypes().size())
                return fail("instances of prototypes are not made at an origin of another version");
        } else {
            ok = map(change.node, change.field);
        }
        if (ok && (change.kind == ChangeKind::addRoute || change.kind == ChangeKind::removeRoute)) {
            FieldIndex target = change.field2();
            ok = map(change.other, target);
            change.index = target;
        }
        if (!ok) return ok;
    }
    return {};
}

}  // namespace rtsg
