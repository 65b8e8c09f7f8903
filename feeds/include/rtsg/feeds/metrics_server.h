// MetricsServer: offers measurements of a running program to Prometheus and `rtsg top`, by HTTP at /metrics, and says
// at /healthz whether it is well.
//
// Invariant: it answers GET and HEAD, one request for each connection, with the text that the program makes at that
// moment; nothing is computed otherwise. Connections, requests and their time are bounded. Threading: a thread of its
// own, on which the program's text is made. Source: Prometheus' text format 0.0.4; HTTP/1.1 (RFC 9112).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

class MetricsServer {
  public:
    /// `listen`: "9100" is that port on loopback, "HOST:9100" another address; port 0 is a free one. `text` is called
    /// on the server's thread, as is `trouble`: a sentence, with which /healthz has status 503, or nothing. Errors:
    /// those of the system; an address that other machines can reach, unless `insecure`.
    static Result<std::unique_ptr<MetricsServer>> start(const std::string& listen, bool insecure,
                                                        std::function<std::string()> text,
                                                        std::function<std::string()> trouble = {});
    ~MetricsServer();
    MetricsServer(const MetricsServer&) = delete;
    MetricsServer& operator=(const MetricsServer&) = delete;

    /// "127.0.0.1:9100", the port filled in.
    const std::string& address() const;

  private:
    struct State;
    explicit MetricsServer(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

/// Fetches the text of such an address ("9100", "HOST:9100", "http://HOST:9100/metrics"). Waits some seconds at most.
Result<std::string> fetchMetrics(const std::string& address);

/// Builds the text: each name once, with its description and all of its values.
class MetricsText {
  public:
    enum class Kind : std::uint8_t { gauge, counter };
    /// `labels`: empty, or `{source="…"}` as label() makes it. Values of one name must follow each other.
    void add(std::string_view name, Kind kind, std::string_view help, double value, std::string_view labels = {});
    /// Adds a histogram of durations: `bounds` in seconds, `counts` for each bound and one more for longer durations.
    void addHistogram(std::string_view name, std::string_view help, std::span<const double> bounds,
                      std::span<const std::uint64_t> counts, double sum);
    static std::string label(std::string_view name, std::string_view value);
    std::string take() { return std::move(text_); }

  private:
    void head(std::string_view name, std::string_view kind, std::string_view help);
    std::string text_, last_;
};

}  // namespace rtsg
