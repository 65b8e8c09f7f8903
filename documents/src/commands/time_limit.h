// The time that reading a document with all its Inlines may take, counted from its start.
//
// Threading: values.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace rtsg::detail {

struct TimeLimit {
    std::uint64_t seconds = UINT64_MAX;
    std::chrono::steady_clock::time_point started = std::chrono::steady_clock::now();

    bool isOver() const {
        return seconds != UINT64_MAX && std::chrono::duration<double>(std::chrono::steady_clock::now() - started) >
                                            std::chrono::duration<double>(static_cast<double>(seconds));
    }
    /// Whole seconds that are left, at least one.
    std::uint64_t left() const {
        const auto passed =
            std::chrono::duration_cast<std::chrono::seconds>(std::chrono::steady_clock::now() - started);
        const auto gone = static_cast<std::uint64_t>(passed.count());
        return gone < seconds ? seconds - gone : 1;
    }
    std::string text() const {
        return "reading takes more than " + std::to_string(seconds) +
               " seconds; the rest is left out, unless --limit seconds=N raises this";
    }
};

}  // namespace rtsg::detail
