// Health: the figures that a long session shows of itself, for Prometheus and `rtsg top`, and whether it still runs.
//
// Threading: the scene's thread notes figures; they are read on the server's.
#pragma once

#include <array>
#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/feeds/metrics_server.h>
#include <rtsg/sync/mirror_client.h>
#include <rtsg/sync/mirror_server.h>

namespace rtsg {

/// What a feed or publisher has counted: lines, events and what was left out.
struct EndpointCounts {
    std::string endpoint;
    std::vector<std::pair<std::string, std::uint64_t>> counts;
};

class Health {
  public:
    Health() = default;
    ~Health() { server_.reset(); }
    Health(const Health&) = delete;
    Health& operator=(const Health&) = delete;

    /// Begins to serve at a PORT on loopback, or ADDRESS:PORT; not if that is empty. `insecure`: others may reach it.
    Result<> start(const std::string& listen, bool insecure);
    bool serves() const { return server_ != nullptr; }
    /// "127.0.0.1:9100"; empty if nobody is served.
    std::string address() const { return server_ ? server_->address() : std::string(); }

    /// Records a frame for later reports: the time it took, and the state and scene time it led to.
    void noteFrame(std::chrono::nanoseconds took, std::uint64_t state, double time);
    static constexpr std::chrono::seconds kPatience{10};
    void noteFeeds(std::vector<EndpointCounts> counts);
    /// This, or noteMirror(), is called in each round of the session's loop, at rest too: without it for kPatience, and
    /// for three times as long as the last round took, the session counts as hung, and /healthz says so.
    void noteServer(const MirrorServer& server);
    void noteLog(std::uint64_t bytes);
    void noteMirror(const MirrorStatistics& mirror, std::uint64_t garbage);

  private:
    static constexpr std::array<double, 10> kBounds{.0005, .001, .002, .004, .008, .0167, .0333, .1, .25, 1};
    std::string text() const;
    std::string trouble() const;
    void noteRound();
    void addServer(MetricsText& text) const;
    void addMirror(MetricsText& text) const;

    mutable std::mutex mutex_;
    std::array<std::uint64_t, kBounds.size() + 1> frames_{};
    std::chrono::steady_clock::time_point lastRound_ = std::chrono::steady_clock::now();
    std::chrono::steady_clock::duration round_{};
    double seconds_ = 0, time_ = 0;
    std::uint64_t state_ = 0, logBytes_ = 0;
    std::optional<MirrorServerStatistics> peers_;
    std::optional<MirrorStatistics> mirror_;
    std::vector<EndpointCounts> feeds_;
    std::unique_ptr<MetricsServer> server_;
};

}  // namespace rtsg
