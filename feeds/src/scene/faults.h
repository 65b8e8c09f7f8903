// Faults: counts invalid lines, and reports them as long as there are few.
//
// Threading: any thread.
#pragma once

#include <bit>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/diagnostic.h>

namespace rtsg::feeds {

class Faults {
  public:
    explicit Faults(std::string source) : source_(std::move(source)) {}

    /// Counts a fault of this kind. `text()` is called only if it is told: the first eight of a kind are, and then each
    /// that doubles their number.
    template <class Text>
    void add(std::string_view kind, std::uint64_t line, std::uint32_t column, DiagnosticCode code, Text&& text) {
        const std::scoped_lock lock(mutex_);
        ++count_;
        auto found = kinds_.find(kind);
        if (found == kinds_.end()) found = kinds_.emplace(std::string(kind), 0).first;
        const std::uint64_t times = ++found->second;
        if (times > kAllReported && !std::has_single_bit(times)) return;
        std::string said = text();
        if (times > kAllReported) said += fmt::format("; {} such lines by now", times);
        report({Severity::warning, source_, {static_cast<std::uint32_t>(line), column}, std::move(said), code});
    }
    void note(std::string text) {
        const std::scoped_lock lock(mutex_);
        report({Severity::warning, source_, {}, std::move(text)});
    }
    std::uint64_t count() const {
        const std::scoped_lock lock(mutex_);
        return count_;
    }
    std::vector<Diagnostic> take() {
        const std::scoped_lock lock(mutex_);
        return std::exchange(reported_, {});
    }

  private:
    static constexpr std::uint64_t kAllReported = 8;
    static constexpr std::size_t kMaxWarnings = 100;
    void report(Diagnostic diagnostic) {
        if (reported_.size() < kMaxWarnings) reported_.push_back(std::move(diagnostic));
    }

    const std::string source_;
    mutable std::mutex mutex_;
    std::uint64_t count_ = 0;
    std::map<std::string, std::uint64_t, std::less<>> kinds_;  // a few words of ours, never what came
    std::vector<Diagnostic> reported_;
};

}  // namespace rtsg::feeds
