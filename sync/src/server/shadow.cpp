// The mirror server's own replica: follows what is published and answers what would take the other threads too long.
#include "shadow.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <rtsg/core/change_composer.h>

#include "edits/questions.h"
#include "superseded.h"

namespace rtsg {

using namespace std::chrono_literals;
using mirror::Message;

namespace {

constexpr std::uint64_t kBatch = std::uint64_t{4} << 20;          // bytes that may wait until the thread has time
constexpr std::uint64_t kWorthWaking = std::uint64_t{256} << 10;  // bytes of memory; less is quickly caught up with
constexpr auto kLeisure = 50ms;
constexpr int kNiceness = 5;          // lower priority than the scene's and the sockets' thread
constexpr std::size_t kMaxEased = 8;  // peers with NearFirst; each costs a scene
constexpr auto kUnusedEased = 10s;
constexpr std::size_t kMaxMergedKept = 8;                           // merged frames that are kept for other peers,
constexpr std::uint64_t kMergedKeptBytes = std::uint64_t{1} << 20;  // and their bytes, if there are several
constexpr int kEasedFraction = 20;  // a new one is made after this many times its own cost

}  // namespace

MirrorShadow::MirrorShadow(const Clock& clock, std::shared_ptr<RecordPool> pool, const Wakeup& wake,
                           std::uint64_t limit, std::size_t index)
    : clock_(clock), pool_(std::move(pool)), wake_(wake), limit_(limit), maximumIndexed_(index), decoder_({}, 0) {
    if (clock_.isStepped()) return;
    worker_.run([this] { run(); },
                [this] {
                    const std::scoped_lock lock(mutex_);
                    some_.notify_one();
                });
}

void MirrorShadow::onSnapshot(TakeSnapshot take) {
    const std::scoped_lock lock(mutex_);
    takeSnapshot_ = std::move(take);
}

/// With `mutex_` held. Small frames wait until there are several, or somebody asks.
bool MirrorShadow::isWorthWaking() const {
    return waitingBytes_ >= kWorthWaking || ((eager_ || hurries_) && !waiting_.empty());
}

/// With `mutex_` held. Those who wait for a snapshot of a dropped record learn that there will be none.
void MirrorShadow::dropWaiting() {
    for (const Waiting& one : waiting_)
        if (one.snapshot && takeSnapshot_) takeSnapshot_(one.record->header.to, nullptr);
    waiting_.clear();
    waitingBytes_ = 0;
    hurries_ = false;
}

bool MirrorShadow::post(SharedRecord record, bool snapshot) {
    const std::scoped_lock lock(mutex_);
    if (record->header.kind == RecordKind::keyframe) {
        dropWaiting();
        lost_ = false;
    }
    if (lost_) {
        if (snapshot && takeSnapshot_) takeSnapshot_(record->header.to, nullptr);
        return false;
    }
    waitingBytes_ += memoryOf(*record);
    waiting_.push_back({std::move(record), snapshot});
    hurries_ |= snapshot;
    if (waiting_.size() > 1 && waitingBytes_ > limit_) {
        dropWaiting();
        lost_ = true;
        return false;
    }
    if (isWorthWaking()) some_.notify_one();
    return true;
}

void MirrorShadow::ask(Question question) {
    {
        const std::scoped_lock lock(mutex_);
        if (question.kind == Question::Kind::open) eager_ = true;
        questions_.push_back(std::move(question));
    }
    some_.notify_one();
}

std::vector<MirrorShadow::Answer> MirrorShadow::takeAnswers() {
    const std::scoped_lock lock(mutex_);
    return std::exchange(answers_, {});
}

void MirrorShadow::restart() {
    const std::scoped_lock lock(mutex_);
    questions_.clear();
    answers_.clear();
    dropWaiting();
    lost_ = true;
    eager_ = false;
    ++era_;
}

void MirrorShadow::run() {
    try {
        follow();
    } catch (const std::exception& e) {
        const std::scoped_lock lock(mutex_);
        std::snprintf(failure_, sizeof(failure_), "%s", e.what());
        lost_ = true;
        dropWaiting();
        if (handingOver_ && takeSnapshot_) takeSnapshot_(*handingOver_, nullptr);
        wake_.raise();
    }
}

void MirrorShadow::checkAlive() {
    const std::scoped_lock lock(mutex_);
    if (failure_[0]) throw std::runtime_error(fmt::format("its replica's thread has ended: {}", failure_));
}

void MirrorShadow::follow() {
    ::setpriority(PRIO_PROCESS, static_cast<id_t>(::syscall(SYS_gettid)),
                  kNiceness);  // only a wish, so a refusal does no harm
    std::unique_lock lock(mutex_);
    while (!worker_.stops()) {
        const auto hurries = [this] {
            return worker_.stops() || waitingBytes_ >= kBatch || ((eager_ || hurries_) && !waiting_.empty()) ||
                   (!questions_.empty() && !lost_);
        };
        some_.wait(lock, [&] { return hurries() || isWorthWaking(); });
        some_.wait_for(lock, kLeisure, hurries);
        work(lock);
    }
    lock.unlock();
    scene_.reset();
}

bool MirrorShadow::step() {
    std::unique_lock lock(mutex_);
    if (worker_.stops() || (waiting_.empty() && (questions_.empty() || lost_))) return false;
    work(lock);
    return true;
}

/// With the lock held: takes all records that wait, and one question.
void MirrorShadow::work(std::unique_lock<std::mutex>& lock) {
    if (!scene_) {
        scene_ = std::make_unique<Scene>();  // belongs to the thread that makes it
        scene_->setBehavioursEnabled(false);
    }
    Scene& scene = *scene_;
    if (eraHere_ != era_) {
        parts_.clear();
        eased_.clear();
        merged_.clear();
    }
    eraHere_ = era_;
    while (!waiting_.empty() && !worker_.stops()) {
        const auto [record, snapshot] = std::move(waiting_.front());
        waiting_.pop_front();
        waitingBytes_ -= memoryOf(*record);
        if (snapshot) handingOver_ = record->header.to;
        const SharedRecord next = waiting_.empty() ? nullptr : waiting_.front().record;
        lock.unlock();
        const bool skipped = !snapshot && skip(*record, next.get());
        const bool good = !skipped && follow(scene, record);
        if (snapshot) handOver(scene, record->header.to, good);
        handingOver_.reset();
        lock.lock();
    }
    hurries_ = false;
    if (worker_.stops() || questions_.empty() || lost_) return;
    const Question question = std::move(questions_.front());
    questions_.pop_front();
    lock.unlock();
    if (question.kind == Question::Kind::open)
        openPart(scene, question);
    else if (question.kind == Question::Kind::close)
        parts_.erase(question.part);
    else
        reply(answer(scene, question));
    lock.lock();
    if (parts_.empty() && questions_.empty()) eager_ = false;
}

void MirrorShadow::reply(Answer answer) {
    const std::scoped_lock lock(mutex_);
    if (eraHere_ != era_) return;
    answer.era = eraHere_;
    answers_.push_back(std::move(answer));
    wake_.raise();
}

/// Opens a part from an earlier state on, so that peers who have that state need no snapshot. Returns false if that is
/// impossible.
bool MirrorShadow::openEarlier(const Scene& scene, const Question& question) {
    MirrorPart part(question.wishes);
    Scene past;
    past.setBehavioursEnabled(false);
    std::vector<Answer> steps;
    SpatialIndex index(maximumIndexed_);  // the shapes' places in the past
    if (part.region()) index.coverRadius(part.region()->radius);
    const auto step = [&](const Scene& whole, const ChangeSet* set) {
        const bool follows = !part.region() || index.follow(whole, set);
        Answer frame = frameOf(part, whole, set, follows ? &index : nullptr, 0);
        frame.part = question.part;
        const bool good = frame.record != nullptr;
        steps.push_back(std::move(frame));
        return good;
    };
    for (const SharedRecord& record : question.frames) {
        const auto set = std::make_shared<ChangeSet>();
        if (record->header.to > scene.sequence()) return false;
        if (!decoder_.decode(record->bytes.bytes(), *set) || !past.apply(set)) return false;
        if (!step(past, steps.empty() ? nullptr : set.get())) return false;
    }
    if (past.sequence() != scene.sequence() && !step(scene, nullptr)) return false;
    parts_.try_emplace(question.part, std::move(part));
    for (Answer& frame : steps) reply(std::move(frame));
    return true;
}

void MirrorShadow::openPart(const Scene& scene, const Question& question) {
    if (!question.frames.empty() && !parts_.contains(question.part) && openEarlier(scene, question)) return;
    const auto [part, fresh] = parts_.try_emplace(question.part, question.wishes);
    if (!fresh) return;
    findSpatialIndex(scene, nullptr);
    Answer first = frameOf(part->second, scene, nullptr, index_.get(), 0);
    first.part = question.part;
    if (!first.record) parts_.erase(part);
    reply(std::move(first));
}

/// The part's next step. It has no record if the part cannot be followed any more.
MirrorShadow::Answer MirrorShadow::frameOf(MirrorPart& part, const Scene& scene, const ChangeSet* set,
                                           const SpatialIndex* index, std::uint64_t published) {
    Answer frame;
    frame.kind = Question::Kind::frame;
    if (part.region() && !index) {
        frame.why = fmt::format("shapes stand in more than {} places, the most among which regions are followed here",
                                maximumIndexed_);
        return frame;
    }
    if (const auto step = part.follow(scene, set, index)) {
        const std::shared_ptr<EncodedRecord> record = encode(**step);
        record->published = published;
        frame.record = record;
    }
    return frame;
}

/// Finds the places of shapes, for all regions together. `set` is null if the scene is unchanged and the regions may be
/// others.
void MirrorShadow::findSpatialIndex(const Scene& scene, const ChangeSet* set) {
    double smallest = std::numeric_limits<double>::infinity();
    for (const auto& [number, part] : parts_)
        if (part.region()) smallest = std::min(smallest, part.region()->radius);
    if (!std::isfinite(smallest)) return index_.reset();
    // Cells that are too large only cost time. So do new regions, each time the smallest radius shrinks.
    const bool fits = index_ && smallest >= cells_ && smallest <= 16 * cells_;
    if (!set && fits && index_->state() == scene.sequence()) return;
    if (!fits) {
        if (!index_) index_ = std::make_unique<SpatialIndex>(maximumIndexed_);
        index_->coverRadius(smallest);
        cells_ = smallest;
    }
    if (!index_->follow(scene, fits ? set : nullptr)) index_.reset();
}

void MirrorShadow::followParts(const Scene& scene, const ChangeSet* set, std::uint64_t published) {
    findSpatialIndex(scene, set);
    for (auto part = parts_.begin(); part != parts_.end();) {
        Answer frame = frameOf(part->second, scene, set, index_.get(), published);
        frame.part = part->first;
        part = frame.record ? std::next(part) : parts_.erase(part);
        reply(std::move(frame));
    }
}

/// True for a frame that nobody needs, because the next one gives all its values anew.
bool MirrorShadow::skip(const EncodedRecord& record, const EncodedRecord* next) {
    // Predictions refer to what frames left in memory, so frames with flags are all read.
    const auto isFrame = [](const RecordHeader& h) {
        return h.kind == RecordKind::frame && h.from != h.to && h.flags == 0;
    };
    if (!parts_.empty() || !next || !isFrame(record.header) || !isFrame(next->header)) return false;
    if (!mirror::isSuperseded(record.bytes.bytes(), next->bytes.bytes())) return false;
    if (!skippedFrom_) skippedFrom_ = record.header.from;
    return true;
}

/// Gives the snapshot of this state to whoever wants it. The scene is in that state unless something went wrong.
void MirrorShadow::handOver(const Scene& scene, std::uint64_t state, bool good) {
    TakeSnapshot take;
    {
        const std::scoped_lock lock(mutex_);
        take = takeSnapshot_;
    }
    if (take) take(state, good ? std::make_shared<const ChangeSet>(scene.snapshot()) : nullptr);
}

/// Returns false if the replica is lost. It also is if its hash is not the origin's, as nobody may start from it.
bool MirrorShadow::follow(Scene& scene, const SharedRecord& record) {
    const bool whole = record->header.kind == RecordKind::keyframe;
    if (whole || !set_ || set_.use_count() > 1) set_ = std::make_shared<ChangeSet>();
    const std::optional<std::uint64_t> from = std::exchange(skippedFrom_, std::nullopt);
    Result<> ok;
    if (whole && (scene.sequence() != 0 || scene.nodeCount() > 1)) ok = scene.reset();
    if (ok) ok = decoder_.decode(record->bytes.bytes(), *set_);
    if (from && record->header.kind == RecordKind::frame) set_->from = *from;
    const bool applied = ok && scene.apply(set_) && scene.hash() == record->header.hash;
    if (applied) followParts(scene, set_.get(), record->published);
    if (whole) set_.reset();  // frees memory, as frames need less
    if (applied) return true;
    const std::scoped_lock lock(mutex_);
    lost_ = true;
    return false;
}

std::shared_ptr<EncodedRecord> MirrorShadow::encode(const ChangeSet& set) {
    const std::shared_ptr<EncodedRecord> record = pool_->take();
    encoder_.encode(set, record->bytes);
    finishRecord(*record);
    return record;
}

SharedRecord MirrorShadow::merge(const Scene& scene, std::uint32_t part, const std::vector<SharedRecord>& frames) {
    // Several peers often fall behind together, from the same few states.
    const RecordHeader &first = frames.front()->header, &last = frames.back()->header;
    for (const Merged& known : merged_) {
        const RecordHeader& header = known.record->header;
        if (known.part == part && header.from == first.from && header.to == last.to && header.hash == last.hash)
            return known.record;
    }
    ChangeComposer composer;
    ChangeSet set;
    for (const SharedRecord& frame : frames) {
        if (!decoder_.decode(frame->bytes.bytes(), set)) return nullptr;
        composer.add(set);
    }
    const std::shared_ptr<EncodedRecord> merged = encode(composer.take(&scene));
    merged->published = frames.back()->published;
    keepMerged(part, merged);
    return merged;
}

void MirrorShadow::keepMerged(std::uint32_t part, SharedRecord record) {
    merged_.push_front({part, std::move(record)});
    std::uint64_t bytes = 0;
    for (std::size_t i = 0; i < merged_.size(); ++i) {
        bytes += memoryOf(*merged_[i].record);
        if (i > 0 && (i == kMaxMergedKept || bytes > kMergedKeptBytes)) merged_.resize(i);
    }
}

/// Without a NearFirst for the peer, merges as for others and makes one for the next time.
void MirrorShadow::mergeNearFirst(const Scene& scene, const Question& question, Answer& result) {
    const Clock::time_point now = clock_.now();
    std::erase_if(eased_,
                  [&](const auto& e) { return e.first != question.peer && now - e.second.used > kUnusedEased; });
    const std::uint64_t from = question.frames.empty() ? 0 : question.frames.front()->header.from;
    const auto found = eased_.find(question.peer);
    const bool fits = found != eased_.end() && found->second.scene && found->second.session == question.session &&
                      found->second.scene->waits() == question.held &&
                      (question.held || found->second.scene->state() == from);
    if (!fits) {
        if (question.held) return;
        result.record = merge(scene, question.part, question.frames);
        if (scene.sequence() != result.state || (found == eased_.end() && eased_.size() >= kMaxEased)) return;
        Eased& eased = eased_[question.peer];
        eased.scene.reset();
        if (now < eased.again) return;
        if (auto created = NearFirst::of(scene)) eased.scene = std::move(*created);
        eased.session = question.session;
        eased.used = clock_.now();
        eased.again = eased.used + kEasedFraction * (eased.used - now);
        return;
    }
    std::vector<ChangeSet> sets(question.frames.size());
    for (std::size_t i = 0; i < sets.size(); ++i)
        if (!decoder_.decode(question.frames[i]->bytes.bytes(), sets[i])) return;
    found->second.used = now;
    NearFirst& eased = *found->second.scene;
    const auto set = eased.next(sets, scene, question.budget, question.all, now);
    if (!set) {
        eased_.erase(found);
        return;
    }
    const std::shared_ptr<EncodedRecord> record = encode(**set);
    if (!question.frames.empty()) record->published = question.frames.back()->published;
    result.record = record;
    result.holds = eased.waits();
}

MirrorShadow::Answer MirrorShadow::answer(const Scene& whole, const Question& question) {
    const auto part = parts_.find(question.part);
    const Scene& scene = part == parts_.end() ? whole : part->second.scene();
    Answer result;
    result.kind = question.kind;
    result.part = question.part;
    result.peer = question.peer;
    result.session = question.session;
    result.state = scene.sequence();
    if (question.kind == Question::Kind::keyframe) {
        if (question.part != 0 && part == parts_.end()) return result;
        result.record = encode(scene.snapshot());
        merged_.clear();
        return result;
    }
    if (question.kind == Question::Kind::merge) {
        if (!question.frames.empty()) result.state = question.frames.back()->header.to;
        if (question.nearFirst)
            mergeNearFirst(scene, question, result);
        else
            result.record = merge(scene, question.part, question.frames);
        return result;
    }
    wire::Reader in(question.text);
    const std::optional<Message> type = mirror::readPrologue(in);
    const auto session = in.number<std::uint64_t>();
    auto message = std::make_shared<ByteBuffer>();
    ChangeSet set;
    if (type == Message::doubt) {
        if (mirror::answerDoubt(scene, session, in, *message)) result.message = std::move(message);
    } else if (type == Message::inspect) {
        if (mirror::answerInspect(scene, session, in, *message)) result.message = std::move(message);
    } else if (mirror::answerWant(scene, in, set)) {
        result.record = encode(set);
    }
    return result;
}

}  // namespace rtsg
