// Steps a replay and describes what its log lacks, and what is damaged or out of order.
#include <rtsg/sync/log_check.h>

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace rtsg {

void LogCheck::note(std::uint64_t frame, std::string text) {
    if (loss_) return;
    loss_ = damage_ ? damage_ : Divergence{frame, replayer_.time(), {}, {}, std::move(text)};
    if (!first_) first_ = loss_;
}

void LogCheck::noteDamage(std::uint64_t frame, const LogDamage& damage) {
    damage_ = Divergence{frame,
                         replayer_.time(),
                         {},
                         {},
                         fmt::format("bytes {} to {} of the log are damaged: {}", damage.offset,
                                     damage.offset + damage.length, damage.text)};
    if (!first_) first_ = damage_;
}

/// `arrived` is true if the step has led to a state.
void LogCheck::noteGap(std::uint64_t before, bool arrived) {
    const std::uint64_t now = replayer_.scene().sequence();
    if (arrived && now > before)
        note(before + 1, fmt::format("frames {} to {} are missing", before + 1, now));
    else
        note(before + 1, fmt::format("frames stand behind state {} that do not lead on from it, and no keyframe that "
                                     "they start from: they were not played",
                                     before));
}

/// Describes the gap between the session that ended with state `last` and the one that begins with `next`.
std::string LogCheck::openEnd(std::uint64_t last, std::uint64_t next) const {
    if (replayer_.seam() == Replayer::Seam::beginsBefore)
        return fmt::format(
            "another session follows state {}, in a later piece: nothing tells what came before its "
            "state {}",
            last, next);
    return fmt::format(
        "the session {}: nothing tells what came after state {} and before state {} of the session that "
        "follows it in the log",
        replayer_.seam() == Replayer::Seam::goesOn ? "goes on in a piece that is not in the log" : "was not closed",
        last, next);
}

Result<bool> LogCheck::step() {
    const std::uint64_t before = replayer_.scene().sequence();
    const double endedAt = replayer_.time();
    // Opening the replay has already read up to the first intact head.
    const std::uint64_t from = replayer_.frames() == 0 ? 0 : replayer_.log().position();
    const Result<bool> more = replayer_.step();
    const LogReader& log = replayer_.log();
    // If there is no index, the search for keyframes has noted all damage already, so the place decides.
    const auto damaged = std::ranges::find_if(
        log.damage(), [&](const LogDamage& d) { return d.offset >= from && d.offset < log.position(); });
    damage_.reset();
    if (damaged != log.damage().end()) noteDamage(before + 1, *damaged);
    if (!more) {
        note(before + 1, more.error().text);
        return more;
    }
    if (std::exchange(unclosed_, replayer_.unclosedSessions()) < replayer_.unclosedSessions() && !first_ && !openEnd_)
        openEnd_ = Divergence{before + 1, endedAt, {}, {}, openEnd(before, replayer_.scene().sequence())};
    if (std::exchange(gaps_, replayer_.gaps()) < replayer_.gaps()) noteGap(before, *more);
    if (replayer_.framesBehind() > 0)
        note(before + 1, fmt::format("{} frames of earlier states stand after state {}, and were not played: the "
                                     "pieces of the log are in another order than they were written in",
                                     replayer_.framesBehind(), before));
    if (!loss_ && replayer_.divergence()) loss_ = replayer_.divergence();
    if (!first_) first_ = loss_;
    return more;
}

void LogCheck::expectClosed() {
    if (openEnd_) first_ = openEnd_;  // it was noted only while there was nothing else, so it came first
    if (replayer_.log().closed()) return;
    const std::uint64_t last = replayer_.scene().sequence();
    if (replayer_.log().beingWritten())
        note(last + 1, fmt::format("the log is still being written: states after {} are yet to come", last));
    else if (replayer_.log().goesOn())
        note(last + 1, fmt::format("the session goes on in a next piece, which is not in the log: nothing here tells "
                                   "what came after state {}",
                                   last));
    else
        note(last + 1, fmt::format("the log was not closed: nothing tells what came after state {}", last));
}

}  // namespace rtsg
