// Counts the records of a log, and the nodes of its last state.
#include <rtsg/sync/log_summary.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <limits>

#include <rtsg/core/scene.h>
#include <rtsg/sync/replay.h>
#include <rtsg/sync/scene_file.h>

#include "index.h"

namespace rtsg {

namespace {

class Counter {
  public:
    explicit Counter(LogSummary& summary) : s_(summary) {}

    void take(const LogReader::Record& record) {
        const RecordHeader& header = record.header;
        s_.closed = saysEnd(header);
        s_.goesOn = saysGoesOn(header);
        if (header.kind == RecordKind::head) return takeHead(record);
        if (header.kind == RecordKind::index) return;
        follow(header);
        const bool again = header.kind == RecordKind::keyframe && header.to == lastKeyframe_;
        if (header.kind == RecordKind::keyframe) {
            lastKeyframe_ = header.to;
            s_.keyframes += !again;
        }
        if (header.kind == RecordKind::input) ++s_.inputs;
        // A frame counts once, however many records it has.
        if (header.from != header.to && header.kind != RecordKind::keyframe && header.to != lastStep_) {
            ++s_.frames;
            lastStep_ = header.to;
        }
        if (std::exchange(first_, false)) {
            s_.firstState = header.to;
            s_.start = s_.end = header.time;
        }
        s_.lastState = header.to;
        shift_ += std::max(0.0, s_.end - (header.time + shift_));
        s_.end = header.time + shift_;
    }

    /// Call it after the last record.
    void end() {
        if (missing_) s_.missingFrames += seen_ - state_;
    }

  private:
    /// Follows the state numbers as a replay would.
    void follow(const RecordHeader& header) {
        const bool keyframe = header.kind == RecordKind::keyframe;
        const bool runs = runs_ && header.kind == RecordKind::input && header.from != header.to;
        if (!keyframe && !runs && header.kind != RecordKind::frame) return;
        if (!lost_ && header.from == state_ && !keyframe) {
            reach(header.to);
            return;
        }
        if (!lost_ && header.to <= state_) {
            if (!keyframe && header.to < state_) ++s_.framesBehind;
            return;
        }
        if (!lost_ && !(keyframe && header.from == state_)) miss(state_);
        if (!keyframe) {
            if (!missing_) miss(header.from);
            seen_ = std::max(seen_, header.to);
            return;
        }
        if (s_.sessions == 0) return;  // before the first head nothing says what the frame holds
        if (std::exchange(missing_, false) && header.to > state_) s_.missingFrames += header.to - state_;
        if (std::exchange(lost_, false))
            ++s_.states;
        else
            reach(header.to);
        state_ = header.to;
    }
    void reach(std::uint64_t state) {
        s_.states += state != state_;
        state_ = state;
    }
    /// Notes that states after `last` are missing.
    void miss(std::uint64_t last) {
        lost_ = missing_ = true;
        ++s_.gaps;
        state_ = seen_ = last;
    }
    void takeHead(const LogReader::Record& record) {
        const auto head = decodeHead(record.bytes);
        if (!head) return;
        runs_ = head->mode.mode == Mode::input;
        if (s_.sessions == 0 || head->epoch != epoch_) {
            if (s_.sessions > 0) {
                end();
                lost_ = true;
                missing_ = false;
            }
            ++s_.sessions;
            lastStep_ = lastKeyframe_ = std::numeric_limits<std::uint64_t>::max();
        }
        epoch_ = head->epoch;
        s_.creator = head->creator;
        s_.mode = nameOf(head->mode.mode);
        s_.coding = nameOf(head->mode.coding);
    }

    LogSummary& s_;
    bool first_ = true;
    double shift_ = 0;  // added to times of a session that begins earlier than the last one ended
    std::uint64_t epoch_ = 0, lastStep_ = 0, lastKeyframe_ = 0;
    bool runs_ = false;                   // the stream is in input mode
    bool lost_ = true, missing_ = false;  // waiting for a keyframe; frames are missing
    std::uint64_t state_ = 0, seen_ = 0;  // last state reached; last state of a record that could not be used
};

}  // namespace

bool isLog(const std::filesystem::path& file) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error) || !isSceneFile(file)) return false;
    std::array<std::byte, kRecordHeaderSize> first{};
    std::ifstream(file, std::ios::binary).read(reinterpret_cast<char*>(first.data()), first.size());
    const auto header = parseRecordHeader(first);
    if (header && header->kind == RecordKind::scene) return false;
    auto log = LogReader::open(file);
    if (!log) return true;
    const auto record = log->next();
    if (!record || record->header.kind != RecordKind::head) return true;  // damaged, but a log
    const auto head = decodeHead(record->bytes);
    return !head || head->epoch != 0;  // scene files have epoch 0
}

Result<LogSummary> summariseLog(const std::filesystem::path& file) {
    auto log = LogReader::open(file);
    if (!log) return std::unexpected(log.error());
    LogSummary summary;
    summary.bytes = log->size();
    Counter counter(summary);
    while (const std::optional<LogReader::Record> record = log->next()) counter.take(*record);
    counter.end();
    summary.beingWritten = log->beingWritten();
    summary.damaged = log->damage().size();
    for (const LogDamage& damage : log->damage()) summary.damagedBytes += damage.length;
    auto replayer = Replayer::open(file);
    if (!replayer) return std::unexpected(replayer.error());
    if (!(*replayer)->seek(std::numeric_limits<double>::infinity())) return summary;  // no state is intact
    const Scene& scene = (*replayer)->scene();
    scene.forEachNode([&](const Node& node) {
        if (node.id() == scene.root()) return;
        ++summary.nodes;
        ++summary.types[node.type().name];
    });
    return summary;
}

}  // namespace rtsg
