// Turns the counts of a server, a mirror and feeds into named metrics.
#include <rtsg/session/health.h>

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/machine.h>

namespace rtsg {

using Kind = MetricsText::Kind;

Result<> Health::start(const std::string& listen, bool insecure) {
    if (listen.empty()) return {};
    auto server = MetricsServer::start(listen, insecure, [this] { return text(); }, [this] { return trouble(); });
    if (!server) return fail(server.error().code, "--metrics-port " + server.error().text);
    server_ = std::move(*server);
    return {};
}

void Health::noteFrame(std::chrono::nanoseconds took, std::uint64_t state, double time) {
    if (!server_) return;
    const double seconds = std::chrono::duration<double>(took).count();
    const std::scoped_lock lock(mutex_);
    ++frames_[static_cast<std::size_t>(std::ranges::lower_bound(kBounds, seconds) - kBounds.begin())];
    seconds_ += seconds;
    state_ = state;
    time_ = time;
}

void Health::noteServer(const MirrorServer& server) {
    if (!server_) return;
    const MirrorServerStatistics statistics = server.statistics();
    const std::scoped_lock lock(mutex_);
    peers_ = statistics;
    noteRound();
}

void Health::noteFeeds(std::vector<EndpointCounts> counts) {
    const std::scoped_lock lock(mutex_);
    feeds_ = std::move(counts);
}

void Health::noteLog(std::uint64_t bytes) {
    const std::scoped_lock lock(mutex_);
    logBytes_ = bytes;
}

void Health::noteMirror(const MirrorStatistics& mirror, std::uint64_t garbage) {
    if (!server_) return;
    const std::scoped_lock lock(mutex_);
    mirror_ = mirror;
    mirror_->garbage += garbage;
    noteRound();
}

void Health::addServer(MetricsText& text) const {
    const MirrorServerStatistics& s = *peers_;
    const auto count = [&](std::string_view name, std::string_view help, std::uint64_t value) {
        text.add(name, Kind::counter, help, static_cast<double>(value));
    };
    text.add("rtsg_peers", Kind::gauge, "Mirrors that follow now.", static_cast<double>(s.peers));
    text.add("rtsg_lag_states", Kind::gauge, "States that the slowest mirror has yet to acknowledge.",
             static_cast<double>(s.peers > 0 ? s.sequence - std::min(s.acknowledged, s.sequence) : 0));
    count("rtsg_sent_bytes_total", "Bytes of records sent to all mirrors.", s.bytes);
    count("rtsg_snapshots_total", "Whole states that began to be sent.", s.snapshots);
    count("rtsg_merged_frames_total", "Frames that reached a slow mirror merged with others.", s.merged);
    count("rtsg_mismatch_questions_total", "Questions of mirrors about hashes that differ.", s.questions);
    count("rtsg_repairs_total", "Records of differing nodes that were sent again.", s.repairs);
    count("rtsg_resumed_peers_total", "Mirrors that came back and needed no whole state.", s.resumed);
    count("rtsg_lost_peers_total", "Mirrors forgotten after silence.", s.lost);
    count("rtsg_refused_total", "Mirrors turned away.", s.refused);
    count("rtsg_garbage_total", "Messages and connections that made no sense.", s.garbage);
    count("rtsg_requests_total", "Requests of mirrors, carried out or refused.", s.requests);
    count("rtsg_stalls_total", "Snapshots that the scene's thread had to take.", s.stalls);
}

void Health::addMirror(MetricsText& text) const {
    const MirrorStatistics& s = *mirror_;
    const auto count = [&](std::string_view name, std::string_view help, std::uint64_t value) {
        text.add(name, Kind::counter, help, static_cast<double>(value));
    };
    text.add("rtsg_equal", Kind::gauge, "1 if this replica's state has the origin's hash.", s.equal ? 1 : 0);
    text.add("rtsg_lag_states", Kind::gauge, "States that the origin is ahead.",
             static_cast<double>(s.originSequence - std::min(s.sequence, s.originSequence)));
    text.add("rtsg_lag_seconds", Kind::gauge, "Age of the last frame when it was applied.", s.lag);
    count("rtsg_frames_total", "Change sets applied.", s.frames);
    count("rtsg_received_bytes_total", "Bytes of records received.", s.bytes);
    count("rtsg_snapshots_total", "Whole states among the frames.", s.snapshots);
    count("rtsg_gaps_total", "Frames found missing.", s.gaps);
    count("rtsg_mismatches_total", "Times that the replica was found to differ from the origin.", s.divergences);
    count("rtsg_repairs_total", "Mismatches that were repaired without a whole state.", s.repairs);
    count("rtsg_garbage_total", "Messages that made no sense.", s.garbage);
    text.add("rtsg_state", Kind::gauge, "Number of the present state.", static_cast<double>(s.sequence));
}

void Health::noteRound() {
    const auto now = std::chrono::steady_clock::now();
    round_ = now - std::exchange(lastRound_, now);
}

std::string Health::trouble() const {
    const std::scoped_lock lock(mutex_);
    const auto still = std::chrono::steady_clock::now() - lastRound_;
    if (still <= std::max<std::chrono::steady_clock::duration>(kPatience, 3 * round_)) return {};
    return fmt::format("the session has not moved for {} s",
                       std::chrono::duration_cast<std::chrono::seconds>(still).count());
}

std::string Health::text() const {
    MetricsText text;
    text.add("rtsg_memory_bytes", Kind::gauge, "Memory that the process holds.", static_cast<double>(heldMemory()));
    const std::scoped_lock lock(mutex_);
    if (!mirror_) {
        text.addHistogram("rtsg_frame_seconds", "Time that frames took.", kBounds, frames_, seconds_);
        text.add("rtsg_state", Kind::gauge, "Number of the present state.", static_cast<double>(state_));
        text.add("rtsg_scene_seconds", Kind::gauge, "Scene time since the start.", time_);
    }
    if (peers_) addServer(text);
    if (mirror_) addMirror(text);
    if (logBytes_ > 0)
        text.add("rtsg_log_bytes_total", Kind::counter, "Bytes of the log.", static_cast<double>(logBytes_));
    static constexpr std::string_view kHelp = "Of feeds and publishers: lines, events and what was left out.";
    static constexpr std::pair<std::string_view, std::string_view> kNames[] = {
        {"lines", "rtsg_feed_lines_total"},     {"events", "rtsg_feed_events_total"},
        {"merged", "rtsg_feed_merged_total"},   {"faulty", "rtsg_feed_faulty_total"},
        {"flooded", "rtsg_feed_flooded_total"}, {"missed", "rtsg_feed_missed_total"}};
    for (const auto& [what, name] : kNames)
        for (const EndpointCounts& one : feeds_)
            for (const auto& [counted, value] : one.counts)
                if (counted == what)
                    text.add(name, Kind::counter, kHelp, static_cast<double>(value),
                             MetricsText::label("place", one.endpoint));
    return text.take();
}

}  // namespace rtsg
